#pragma once

#include <functional>
#include <optional>
#include <string>

#include "avatar/nets/transfer.h"
#include "cli/program/command.h"
#include "stages/nets/avatar_fit.h"

/// What network `avatar train` begins with.
namespace mvstudio::cli {

struct StartArguments {
  std::string init_from;                                 ///< a run whose network is the start; empty: none
  avatar::ModelOptions model;                            ///< as asked for
  stages::BodyFitMode fit = stages::BodyFitMode::kAuto;  ///< the body that maps and labels show
  std::function<bool(const std::string&)> given;         ///< whether the command line has this option
};

/// The network to start from, if any. Throws UsageError for options that it has not.
std::optional<avatar::AvatarModel> StartOf(const StartArguments& arguments);

/// The new network's options with every choice made. `labelled`: the first guess is DensePose's.
avatar::ModelOptions ModelOf(const StartArguments& arguments, const std::optional<avatar::AvatarModel>& from, bool labelled);

/// Says in a result which layers are the other network's.
void TellStart(const StartArguments& arguments, const avatar::AvatarModel& from, const avatar::StartNetwork& start,
               CommandResult* result);

}  // namespace mvstudio::cli
