#pragma once

#include <utility>
#include <vector>

#include "core/progress.h"
#include "geometry/rig.h"
#include "triangulate/association.h"
#include "triangulate/types.h"

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

/// The joints of the people that several cameras see, by frame, person, joint; those seen by fewer than two cameras are left
/// out.
std::vector<KeypointJoint> CollectKeypoints(const geometry::Rig& rig, const std::vector<triangulate::DetectedFrame>& frames,
                                            const triangulate::AssociationOptions& options, const RunContext& run);

std::vector<KeypointJoint> JointsIn(const std::vector<KeypointJoint>& joints, const FrameChoice& choice);

/// Frames that occur among the joints, ascending.
std::vector<int> FramesOf(const std::vector<KeypointJoint>& joints);

/// The joints of at most `max_frames` frames, evenly spread.
std::vector<KeypointJoint> Thinned(const std::vector<KeypointJoint>& joints, int max_frames);

}  // namespace mvstudio::calib
