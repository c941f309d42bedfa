#pragma once

#include "stages/markers/run.h"
#include "stages/result.h"

namespace mvstudio::stages {

CommandResult Describe(const MarkersReport& report);
CommandResult Describe(const MarkerEventsReport& report);
/// What the format cannot hold of each person is said.
CommandResult Describe(const MarkerConvertReport& report);

}  // namespace mvstudio::stages
