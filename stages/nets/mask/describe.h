#pragma once

#include "stages/nets/mask/run.h"
#include "stages/result.h"

namespace mvstudio::stages {

/// The masks in figures, and where they are doubtful.
CommandResult Describe(const MaskStageReport& report);

}  // namespace mvstudio::stages
