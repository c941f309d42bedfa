#pragma once

#include "stages/result.h"
#include "stages/synth/run.h"

namespace mvstudio::stages {

/// The session's size and files, and how far cloth and muscles go beyond skinning; or why nothing was written.
CommandResult Describe(const SynthReport& report);

}  // namespace mvstudio::stages
