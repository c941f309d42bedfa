#pragma once

#include "stages/nets/fit/run.h"
#include "stages/result.h"

namespace mvstudio::stages {

/// How well the body lies on its silhouettes, as metrics and tables, its files, and what is wrong with them.
CommandResult Describe(const AvatarFitReport& report);

}  // namespace mvstudio::stages
