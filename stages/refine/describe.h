#pragma once

#include "stages/refine/run.h"
#include "stages/result.h"

namespace mvstudio::stages {

/// Held-out errors before and after, what each camera became, and what the detections say against the result.
CommandResult Describe(const RefineReport& report);

}  // namespace mvstudio::stages
