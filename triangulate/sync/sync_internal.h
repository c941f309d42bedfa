#pragma once

#include <Eigen/Core>
#include <map>
#include <optional>
#include <vector>

#include "triangulate/sync/sync.h"

/// Steps of SynchronizeCameras; included by the .cc files of this folder and their tests only.
namespace mvstudio::triangulate::internal {

constexpr int kSyncBlocks = 16;

/// Cost of every whole offset of two cameras: frame f of `a` with frame f + d of `b`. The frames of `a` are divided into
/// blocks.
struct PairCurve {
  int a = 0, b = 0;
  int first = 0;  ///< d of the first entry
  struct Entry {
    double sum[kSyncBlocks] = {};  // truncated distances, px
    int num[kSyncBlocks] = {};
    bool admissible = false;  ///< enough frames in common
  };
  std::vector<Entry> entries;
  double typical = 0;  ///< median over admissible offsets of the mean cost; 0: the pair cannot be used

  bool usable() const { return typical > 0; }
  /// Mean cost over `typical`, blocks weighted; 1 (no information) where not admissible.
  double Cost(int d, const int* block_weights = nullptr) const;
  /// The admissible offset of lowest cost.
  int Best() const;
};

/// All pairs of cameras.
std::vector<PairCurve> ComputePairCurves(const PreparedRig& rig, const std::vector<DetectedFrame>& frames,
                                         const SyncOptions& options, const RunContext& run);

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

struct FineSync {
  bool ok = false;
  std::vector<double> offset_frames, sigma_frames;  // (cameras); NaN where the camera takes no part
  double residual_before_px = 0, residual_after_px = 0;
  int num_points = 0;
};

/// `start_frames`: whole offsets, empty for excluded cameras.
FineSync RefineOffsets(const PreparedRig& rig, const std::vector<DetectedFrame>& frames,
                       const std::vector<std::optional<int>>& start_frames, int reference_idx, const SyncOptions& options,
                       const RunContext& run);

}  // namespace mvstudio::triangulate::internal
