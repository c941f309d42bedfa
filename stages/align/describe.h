#pragma once

#include "stages/align/run.h"
#include "stages/result.h"

namespace mvstudio::stages {

/// How well the new world is known, what became of the rig, and where its cameras are.
CommandResult Describe(const AlignReport& report);

}  // namespace mvstudio::stages
