#pragma once

#include <string>
#include <vector>

#include "core/progress.h"
#include "stages/nets/trials/trials.h"
#include "stages/stage_call.h"

/// `tradeoff avatar`: every trial of a grid trained and scored.
namespace mvstudio::stages {

struct AvatarTradeoffReport {
  AvatarTradeoffOptions options;    ///< with what was left to be chosen
  std::vector<AvatarTrial> trials;  ///< that are done
  int64_t left_out = 0;             ///< not begun, for the time was over
  std::string page;
};

/// What is finished in the output folder is kept. Throws UsageError for cameras and frames that the dataset does not have,
/// IoError with the command line and its error where a training or an evaluation fails.
AvatarTradeoffReport RunAvatarTradeoff(AvatarTradeoffOptions options, const ChildCall& call, const RunContext& run);

CommandResult Describe(const AvatarTradeoffReport& report);

}  // namespace mvstudio::stages
