#pragma once

#include <functional>
#include <string>
#include <vector>

#include "core/progress.h"
#include "stages/nets/trials/trials.h"
#include "stages/stage_call.h"

/// Trials of `tradeoff avatar`: each is this program's own `avatar train` and `avatar eval` in a process by itself, so that its
/// memory is its own and it can be repeated by hand.
namespace mvstudio::stages {

/// Options of `avatar train` for "l1", "ssim", "gradient" and "posenet" joined by '+'; Gaussians have the first two. Throws
/// UsageError.
std::vector<LineOption> LossFlags(const std::string& loss, const std::string& method);

/// Trains and scores `trial` in a folder below options.out, or reads what an earlier call kept there; an interrupted training
/// goes on. Throws IoError with the command line and its error when the program fails.
void RunTrial(const AvatarTradeoffOptions& options, const ChildCall& call, const RunContext& run,
              const std::function<void()>& poll, AvatarTrial* trial);

}  // namespace mvstudio::stages
