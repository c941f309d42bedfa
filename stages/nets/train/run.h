#pragma once

#include "core/progress.h"
#include "stages/nets/train/options.h"
#include "stages/nets/train/report.h"

namespace mvstudio::stages {

/// Fits the body, makes the crops, trains and writes the run. Throws UsageError, IoError, FormatError and MissingToolError, and
/// CancelledError after a checkpoint; a loss that is not finite is a report with the weights before it.
AvatarTrainReport RunAvatarTrain(AvatarTrainOptions options, RunContext run = {});
/// Continues a run of a network.
AvatarTrainReport RunAvatarResume(const AvatarResumeOptions& options, RunContext run = {});

}  // namespace mvstudio::stages
