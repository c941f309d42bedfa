#include "stages/nets/evaluate/run.h"

#include <chrono>

namespace mvstudio::stages {

AvatarEvalReport RunAvatarEval(const AvatarEvalOptions& options, const RunContext& run) {
  const auto now_s = [] { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); };
  return {options.run_folder, avatar::Evaluate(options.run_folder, options.scores, run, now_s)};
}

}  // namespace mvstudio::stages
