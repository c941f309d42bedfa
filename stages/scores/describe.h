#pragma once

#include "stages/result.h"
#include "stages/scores/run.h"

namespace mvstudio::stages {

/// Means over the pairs, in all of the image and by masks, and the distance between the sets; images without a partner make it
/// partial, sets without any pair an error.
CommandResult Describe(const ScoresReport& report);

}  // namespace mvstudio::stages
