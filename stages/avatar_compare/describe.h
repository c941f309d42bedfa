#pragma once

#include "stages/avatar_compare/run.h"
#include "stages/result.h"

namespace mvstudio::stages {

/// The table, differences between rows, and why some of them say little.
CommandResult Describe(const AvatarCompareReport& report);

}  // namespace mvstudio::stages
