#pragma once

#include <string>
#include <utility>
#include <vector>

#include "triangulate/people/association.h"

namespace mvstudio::triangulate {

/// Joints (left, right) that change places when a detector takes a person's front for the back; in groups that may change
/// places by themselves (head, arms, legs).
using MirrorGroups = std::vector<std::vector<std::pair<int, int>>>;

struct SideOptions {
  double min_score = 0.3;      ///< joints below do not take part
  double sigma_px = 0;         ///< noise of a joint, calibration errors included; 0: estimated from the take
  double min_gain_joints = 3;  ///< a camera is corrected when so many joints more fit the other cameras afterwards, on average
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
  int num_undecided = 0;             ///< people and frames where as many cameras say one thing as the other; left as they are
  double sigma_px = 0;               ///< given or estimated
};

/// Finds detections whose left and right are swapped and swaps them back in place.
///
/// For a person in a frame each camera's detection is as it should be or mirrored. A label is judged by how the rays of the
/// camera's joints pass the points of the other cameras' joints, as they are labelled (AssociateFrame's evidence). From no
/// mirrored camera, and from the most likely labels by pairs of cameras alone, the camera that gains most is turned until none
/// does (iterated conditional modes: Besag, "On the statistical analysis of dirty pictures", 1986). The labels split the
/// cameras into two parties, and the smaller one is mirrored. Two equal parties are told apart by how often their cameras are
/// swapped elsewhere in the take, if at all. A group of joints goes with its body unless the other cameras contradict. A take
/// that all cameras swap cannot be told from one that none does.
///
/// `assignment` is [frame][person][camera] as AssociateTake gives it. The result does not depend on the number of threads.
SideReport FixSides(const PreparedRig& rig, const std::vector<std::vector<std::vector<int>>>& assignment,
                    const MirrorGroups& groups, const SideOptions& options, const RunContext& run,
                    std::vector<DetectedFrame>* frames);

}  // namespace mvstudio::triangulate
