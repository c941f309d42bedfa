// Private: a step of SynchronizeCameras.
#pragma once

#include <cstdint>
#include <vector>

#include "triangulate/sync/sync.h"

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
  /// How far its cost lies below the typical one, 0 to 1.
  double Strength() const { return usable() ? 1 - Cost(Best()) : 0; }
};

/// All pairs of cameras. Frames are thinned out evenly where joints would be compared more often than `max_evaluations` times:
/// many people are compared with each other at every offset.
std::vector<PairCurve> ComputePairCurves(const PreparedRig& rig, const std::vector<DetectedFrame>& frames,
                                         const SyncOptions& options, const RunContext& run,
                                         int64_t max_evaluations = 200'000'000);

}  // namespace mvstudio::triangulate::internal
