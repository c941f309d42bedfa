#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "triangulate/people/association.h"

namespace mvstudio::triangulate {

/// Joints (left, right) that are exchanged when a detector takes a person's front for the back, in groups that may be
/// exchanged separately (head, arms, legs).
using MirrorGroups = std::vector<std::vector<std::pair<int, int>>>;

struct SideOptions {
  double min_score = 0.3;      ///< joints below are ignored
  double sigma_px = 0;         ///< noise of a joint, calibration errors included; 0: estimated from the take
  double min_gain_joints = 3;  ///< a camera is corrected if, on average, this many more joints fit the other cameras
                               ///< afterwards
};

struct CameraSides {
  std::string name;
  int num_frames = 0;       ///< people and frames in which this camera could be judged
  int num_swapped = 0;      ///< of these, corrected
  int num_partly = 0;       ///< of these, in some groups only
  std::vector<int> frames;  ///< numbers of the frames with corrections, ascending
  std::string message;      ///< "cam_02: left and right swapped in 37 of 100 frames"; empty when none
};

struct SideReport {
  std::vector<CameraSides> cameras;  ///< in the rig's order
  int num_swapped = 0;               ///< sum over cameras
  int num_undecided = 0;             ///< people and frames where equally many cameras support either side; left unchanged
  double sigma_px = 0;               ///< given or estimated
};

/// One camera's detection of a person whose left and right are exchanged.
struct SwappedView {
  size_t frame_idx = 0;
  int camera_idx = 0, person_idx = 0;
  uint32_t groups = 0;  ///< a bit for each group of joints
};

/// Finds detections with left and right swapped.
///
/// In each frame, a camera's detection of a person is labelled correct or mirrored. The evidence for a label comes from
/// the distances between the rays of the camera's joints and the points of the other cameras' joints, as those are
/// labelled (as in AssociateFrame). The search starts from no mirrored camera, and from the most likely labels by pairs of
/// cameras alone. The camera that gains most is flipped until none gains (iterated conditional modes: Besag, "On the
/// statistical analysis of dirty images", 1986).
///
/// The labels split the cameras into two groups, and the smaller one is mirrored. Equal groups are distinguished by how
/// often their cameras are swapped elsewhere in the take, if at all. A group of joints is swapped with its body unless the
/// other cameras contradict. A take that all cameras swap cannot be distinguished from one that none does.
///
/// `assignment` is [frame][person][camera] as AssociateTake returns it. The result does not depend on the number of
/// threads.
std::vector<SwappedView> FindSwaps(const PreparedRig& rig, const std::vector<std::vector<std::vector<int>>>& assignment,
                                   const MirrorGroups& groups, const SideOptions& options, const RunContext& run,
                                   const std::vector<DetectedFrame>& frames, SideReport* report);

/// Swaps them back.
void SwapSides(const std::vector<SwappedView>& swaps, const MirrorGroups& groups, std::vector<DetectedFrame>* frames);

/// Both.
SideReport FixSides(const PreparedRig& rig, const std::vector<std::vector<std::vector<int>>>& assignment,
                    const MirrorGroups& groups, const SideOptions& options, const RunContext& run,
                    std::vector<DetectedFrame>* frames);

}  // namespace mvstudio::triangulate
