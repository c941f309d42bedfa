#pragma once

#include <functional>
#include <string>
#include <vector>

#include "cli/program/command.h"
#include "stages/study/avatar_trials.h"

/// Runs the trials of `tradeoff avatar`: each is this program's own `avatar train` and `avatar eval` in a process by itself, so
/// that its memory is its own and it can be repeated by hand.
namespace mvstudio::cli {

/// Flags of `avatar train` for "l1", "ssim", "gradient" and "posenet" joined by '+'; Gaussians have the first two. Throws
/// UsageError.
std::vector<std::string> LossFlags(const std::string& loss, const std::string& method);

/// Trains and scores `trial` in a folder below options.out, or reads what an earlier call kept there; an interrupted training
/// goes on. Throws IoError with the command line and its error when the program fails.
void RunTrial(const stages::AvatarTradeoffOptions& options, const CommandContext& context, const std::function<void()>& poll,
              stages::AvatarTrial* trial);

}  // namespace mvstudio::cli
