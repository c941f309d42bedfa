#pragma once

#include <utility>
#include <vector>

#include "core/progress.h"
#include "geometry/rig/rig.h"
#include "triangulate/people/association.h"
#include "triangulate/point/types.h"

/// Keypoints of people as calibration targets.
namespace mvstudio::calib {

/// One joint of one person in one frame: its observations, at most one per camera.
struct KeypointJoint {
  int frame = 0, person = 0, joint_idx = 0;
  std::vector<triangulate::Observation> seen;
};

/// Frames start, start + step, start + 2 step, …
struct FrameChoice {
  int start = 0, step = 1;
  bool Contains(int frame) const { return frame >= start && (frame - start) % step == 0; }
};

/// People whom several cameras see but AssociationOptions::max_persons excludes.
struct LeftOutPersons {
  int num_persons = 0;      ///< largest number at once in a frame
  std::vector<int> frames;  ///< frames with any, ascending
};

/// Joints of the people that several cameras see, by frame, person, joint; without those that fewer than two cameras see.
/// Of each frame, the max_persons people best supported over the take are used. Identity over time is not needed here, so
/// time steps without a temporal connection lose nobody.
std::vector<KeypointJoint> CollectKeypoints(const geometry::Rig& rig, const std::vector<triangulate::DetectedFrame>& frames,
                                            const triangulate::AssociationOptions& options, const RunContext& run,
                                            LeftOutPersons* left_out = nullptr);

std::vector<KeypointJoint> JointsIn(const std::vector<KeypointJoint>& joints, const FrameChoice& choice);

/// Frames that occur among the joints, ascending.
std::vector<int> FramesOf(const std::vector<KeypointJoint>& joints);

/// The joints of at most `max_frames` frames, evenly spaced.
std::vector<KeypointJoint> Thinned(const std::vector<KeypointJoint>& joints, int max_frames);

/// The joints of evenly spaced frames that hold about `max_observations`, but of at least 20 frames.
std::vector<KeypointJoint> ThinnedTo(const std::vector<KeypointJoint>& joints, size_t max_observations);

size_t NumObservations(const std::vector<KeypointJoint>& joints);

}  // namespace mvstudio::calib
