#pragma once

#include <vector>

#include "core/progress.h"
#include "stages/surface/options.h"

namespace mvstudio::stages {

struct SurfaceReport {
  SurfaceOptions options;
  std::vector<body::BodyScores> scores;  ///< of each of the bodies
};

/// Throws IoError and FormatError; frames without a score are in the report.
SurfaceReport RunSurface(const SurfaceOptions& options, const RunContext& run = {});

}  // namespace mvstudio::stages
