#pragma once

#include "stages/result.h"
#include "stages/view/run.h"

namespace mvstudio::stages {

/// What was shown.
CommandResult Describe(const ViewReport& report);

}  // namespace mvstudio::stages
