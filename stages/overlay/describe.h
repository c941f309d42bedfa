#pragma once

#include "stages/overlay/run.h"
#include "stages/result.h"

namespace mvstudio::stages {

/// What was drawn, and where it lies.
CommandResult Describe(const OverlayReport& report);

}  // namespace mvstudio::stages
