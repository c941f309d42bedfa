#pragma once

#include "stages/result.h"
#include "stages/triangulate/report.h"

namespace mvstudio::stages {

/// Metrics, text, warnings and errors; the exit code of what went wrong.
CommandResult Describe(const TriangulateReport& report);

}  // namespace mvstudio::stages
