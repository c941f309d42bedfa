#pragma once

#include <functional>
#include <string>

#include "avatar/run/gaussians/gaussian_training.h"
#include "stages/nets/avatar_run.h"
#include "stages/nets/avatar_train_data.h"

/// A run of Gaussians: gaussians.npz, gaussians.ply, history.csv and samples beside the configuration.
namespace mvstudio::stages {

/// Throws UsageError where `given` says that an option was asked for that Gaussians do not have.
void RefuseNetworkOptions(const std::function<bool(const std::string&)>& given);
/// The same the other way round: options of Gaussians with a network.
void RefuseGaussianOptions(const std::function<bool(const std::string&)>& given);

struct GaussianRun {
  avatar::GaussianOptions gaussians;
  avatar::TrainOptions networks;                  ///< what the two have in common
  std::function<bool(const std::string&)> given;  ///< whether the command line has an option
  std::function<double()> clock_s;
};

/// Trains, and writes the run's files; `begin` is called before the first is written. Without validation images the last step
/// is kept. Exit code 5 where a loss was not finite.
CommandResult TrainGaussianRun(const GaussianRun& arguments, const avatar::RunConfig& config, const RunPacks& packs,
                               const AvatarRun& files, const std::function<void()>& begin, const RunContext& run);

}  // namespace mvstudio::stages
