#pragma once

#include "stages/nets/pose2d/run.h"
#include "stages/result.h"

namespace mvstudio::stages {

/// What each camera gave, how well the cameras agree, and what was left out.
CommandResult Describe(const Pose2dReport& report);

}  // namespace mvstudio::stages
