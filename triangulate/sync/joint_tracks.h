// Private: a step of SynchronizeCameras.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <utility>
#include <vector>

#include "triangulate/sync/sync.h"

namespace mvstudio::triangulate::internal {

/// A joint of a person in one camera over time, by the camera's frame numbers.
using JointTrack = std::vector<std::pair<int, Eigen::Vector2d>>;

/// [camera][person][joint]
using Tracks = std::vector<std::vector<std::vector<JointTrack>>>;

/// Tracks of the people that association finds after whole offsets are applied, without isolated jumps. `common_frames`
/// receives the frames on the reference's clock that any camera has.
Tracks MakeTracks(const PreparedRig& rig, const std::vector<DetectedFrame>& frames,
                  const std::vector<std::optional<int>>& start_frames, double min_score, const RunContext& run,
                  std::vector<int>* common_frames);

struct TrackSample {
  Eigen::Vector2d px, px_per_frame;
};

/// Value and slope of the quadratic fitted to the samples within 4.5 frames, with triweight weights (1 - (t / 4.5)^2)^3,
/// smooth in `frame`. Empty beyond the ends of the track and inside gaps of 4 frames and more.
std::optional<TrackSample> SampleTrack(const JointTrack& track, double frame);

/// Whether a track has samples 1 to 3 frames before and after a frame. At its ends the noise of a sample's value goes together
/// with that of its slope, which passes as time.
bool HasNeighbours(const JointTrack& track, int frame);

}  // namespace mvstudio::triangulate::internal
