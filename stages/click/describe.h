#pragma once

#include "stages/click/run.h"
#include "stages/result.h"

namespace mvstudio::stages {

/// How many points each camera has, and how well they agree with its lens.
CommandResult Describe(const ClickReport& report);

}  // namespace mvstudio::stages
