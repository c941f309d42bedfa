#pragma once

#include "stages/nets/lift/run.h"
#include "stages/result.h"

namespace mvstudio::stages {

CommandResult Describe(const LiftTrainReport& report);
/// Counts by status; what was refused makes the result partial, or ill-posed when nothing is left.
CommandResult Describe(const LiftApplyReport& report);

}  // namespace mvstudio::stages
