#pragma once

#include "stages/nets/evaluate/run.h"
#include "stages/result.h"

namespace mvstudio::stages {

/// The scores, their files, and where the avatar is no better than what it is compared with.
CommandResult Describe(const AvatarEvalReport& report);

}  // namespace mvstudio::stages
