#pragma once

#include "stages/result.h"
#include "stages/sync/run.h"

namespace mvstudio::stages {

/// The offsets as a table, metrics and an error for each camera without one.
CommandResult Describe(const SyncReport& report);

}  // namespace mvstudio::stages
