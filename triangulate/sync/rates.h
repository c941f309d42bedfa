// Private: a step of SynchronizeCameras.
#pragma once

#include <vector>

#include "triangulate/sync/sync.h"

namespace mvstudio::triangulate::internal {

/// Frames of each camera for one of the camera seen most often, from ratios of usual frame rates; 1 where equal rates do about
/// as well. Looks at the beginning of the take.
std::vector<double> FindRates(const PreparedRig& rig, const std::vector<DetectedFrame>& frames, const SyncOptions& options,
                              const RunContext& run);

}  // namespace mvstudio::triangulate::internal
