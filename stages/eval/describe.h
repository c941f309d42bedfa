#pragma once

#include "stages/eval/run.h"
#include "stages/result.h"

namespace mvstudio::stages {

/// Cameras as a table, metrics, and the verdict's reasons as warnings.
CommandResult Describe(const EvalReport& report);

}  // namespace mvstudio::stages
