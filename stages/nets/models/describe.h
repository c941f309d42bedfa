#pragma once

#include "stages/nets/models/run.h"
#include "stages/result.h"

namespace mvstudio::stages {

/// A line for each network. Exit code 8 where a list finds one that is missing or not sound.
CommandResult Describe(const ModelsReport& report);

}  // namespace mvstudio::stages
