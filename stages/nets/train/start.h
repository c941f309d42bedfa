#pragma once

#include <optional>

#include "avatar/nets/transfer.h"
#include "stages/nets/train/options.h"
#include "stages/nets/train/report.h"

/// What network a training begins with.
namespace mvstudio::stages {

/// The network to start from, if any. Throws UsageError for options that it has not.
std::optional<avatar::AvatarModel> StartOf(const AvatarTrainOptions& options);

/// The new network's options with every choice made.
avatar::ModelOptions ModelOf(const AvatarTrainOptions& options, const std::optional<avatar::AvatarModel>& from);

}  // namespace mvstudio::stages
