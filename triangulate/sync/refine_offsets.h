// Private: a step of SynchronizeCameras.
#pragma once

#include <optional>
#include <vector>

#include "triangulate/sync/sync.h"

namespace mvstudio::triangulate::internal {

struct FineSync {
  bool ok = false;
  std::vector<double> offset_frames, sigma_frames;  // (cameras) in the middle frame; NaN where the camera takes no part
  double middle_frame = 0;
  std::vector<double> drift, sigma_drift;  // (cameras) by which the offset grows in a frame; 0 unless the motion determines it
  double residual_before_px = 0, residual_after_px = 0;
  int num_points = 0;
};

/// `start_frames`: whole offsets, empty for excluded cameras. `repeats`: frames that one image of the slowest camera was
/// resampled to; they share its noise.
FineSync RefineOffsets(const PreparedRig& rig, const std::vector<DetectedFrame>& frames,
                       const std::vector<std::optional<int>>& start_frames, int reference_idx, double repeats,
                       const SyncOptions& options, const RunContext& run);

}  // namespace mvstudio::triangulate::internal
