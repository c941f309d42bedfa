#pragma once

#include "stages/calibrate/run.h"
#include "stages/result.h"

namespace mvstudio::stages {

/// Cameras as a table, metrics, the verdict's reasons as warnings, and an error for each camera that is left out.
CommandResult Describe(const CalibrateReport& report);

}  // namespace mvstudio::stages
