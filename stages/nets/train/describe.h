#pragma once

#include "stages/nets/train/report.h"

namespace mvstudio::stages {

/// How the training went, what it was of, and what is wrong with its images; empty for processes but the first.
CommandResult Describe(const AvatarTrainReport& report);

}  // namespace mvstudio::stages
