#pragma once

#include "stages/calib_files/run.h"
#include "stages/result.h"

namespace mvstudio::stages {

/// A row a camera, and the distances between them.
CommandResult Describe(const CalibShowReport& report);
CommandResult Describe(const CalibConvertReport& report);
CommandResult Describe(const CalibResizeReport& report);
CommandResult Describe(const LensAddReport& report);
CommandResult Describe(const LensListReport& report);

}  // namespace mvstudio::stages
