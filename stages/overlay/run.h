#pragma once

#include <string>
#include <utility>
#include <vector>

#include "core/progress.h"
#include "stages/overlay/options.h"
#include "stages/view/scene.h"

namespace mvstudio::stages {

struct OverlayReport {
  OverlayOptions options;
  InputNotes notes;
  size_t num_cameras = 0, num_steps = 0;
  size_t num_missing = 0;                                    ///< images that the footage does not have
  double rate_hz = 0;                                        ///< of the videos
  std::vector<std::pair<std::string, std::string>> outputs;  ///< path and role
};

/// Writes videos, and a contact sheet, of a session, a dataset, a run or points with their joints drawn over them. Throws
/// UsageError, IoError and FormatError.
OverlayReport RunOverlay(const OverlayOptions& options, const RunContext& run = {});

}  // namespace mvstudio::stages
