#pragma once

#include "stages/result.h"
#include "stages/tradeoff/run.h"

namespace mvstudio::stages {

CommandResult Describe(const CalibrateTradeoffReport& report);
/// Where nothing could be compared with the truth, that is an error.
CommandResult Describe(const TriangulateTradeoffReport& report);

}  // namespace mvstudio::stages
