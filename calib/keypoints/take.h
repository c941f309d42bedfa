#pragma once

#include <utility>
#include <vector>

#include "core/progress.h"
#include "geometry/rig/rig.h"
#include "triangulate/people/association.h"
#include "triangulate/point/types.h"

/// Key points of people as calibration targets.
namespace mvstudio::calib {

/// One joint of one person in one frame: what the cameras saw of it, at most one observation a camera.
struct KeypointJoint {
  int frame = 0, person = 0, joint_idx = 0;
  std::vector<triangulate::Observation> seen;
};

/// Frames start, start + step, start + 2 step, …
struct FrameChoice {
  int start = 0, step = 1;
  bool Contains(int frame) const { return frame >= start && (frame - start) % step == 0; }
};

/// People that several cameras see and whom AssociationOptions::max_persons leaves out.
struct LeftOutPersons {
  int num_persons = 0;      ///< at once, in the frame with most of them
  std::vector<int> frames;  ///< with any, ascending
};

/// The joints of the people that several cameras see, by frame, person, joint; those seen by fewer than two cameras are left
/// out. Of each frame the people who are best supported over the take are used, max_persons of them: who is who over time does
/// not matter here, so that instants without a connection in time lose nobody.
std::vector<KeypointJoint> CollectKeypoints(const geometry::Rig& rig, const std::vector<triangulate::DetectedFrame>& frames,
                                            const triangulate::AssociationOptions& options, const RunContext& run,
                                            LeftOutPersons* left_out = nullptr);

std::vector<KeypointJoint> JointsIn(const std::vector<KeypointJoint>& joints, const FrameChoice& choice);

/// Frames that occur among the joints, ascending.
std::vector<int> FramesOf(const std::vector<KeypointJoint>& joints);

/// The joints of at most `max_frames` frames, evenly spread.
std::vector<KeypointJoint> Thinned(const std::vector<KeypointJoint>& joints, int max_frames);

/// The joints of as many frames, evenly spread, as keep about `max_observations`, but of 20 frames at least.
std::vector<KeypointJoint> ThinnedTo(const std::vector<KeypointJoint>& joints, size_t max_observations);

size_t NumObservations(const std::vector<KeypointJoint>& joints);

}  // namespace mvstudio::calib
