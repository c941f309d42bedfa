#pragma once

#include <string>

#include "core/progress.h"
#include "stages/nets/evaluate/options.h"

namespace mvstudio::stages {

struct AvatarEvalReport {
  std::string folder;  ///< of the run
  avatar::Evaluation evaluation;
};

/// Scores a run on the cameras and frames it never saw. Throws what avatar::Evaluate does.
AvatarEvalReport RunAvatarEval(const AvatarEvalOptions& options, const RunContext& run = {});

}  // namespace mvstudio::stages
