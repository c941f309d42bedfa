#pragma once

#include <functional>

#include "avatar/train/train.h"
#include "cli/avatar/ranks.h"
#include "cli/program/commands.h"
#include "stages/nets/avatar_run.h"
#include "stages/nets/avatar_train_data.h"

/// What `avatar train` and `avatar resume` have in common.
namespace mvstudio::cli {

/// Joins the other ranks, trains, and says how it went. `begin`: called once nothing can be refused any more; `earlier_s`:
/// seconds that the run took before. Ranks but the first return an empty result.
CommandResult TrainHere(avatar::Trainer& trainer, stages::AvatarRun& files, const stages::RunPacks& packs,
                        const avatar::TrainOptions& options, double earlier_s, RankProcesses& ranks, CommandContext& context,
                        const std::function<void()>& begin = {});

/// Adds what both commands say of a run in `folder`: its images, those that the dataset does not hold, and how long all took,
/// `whole_s`, the body's fit and the crops included.
void FillCommon(const avatar::RunConfig& config, const stages::RunPacks& packs, const std::string& folder, double whole_s,
                CommandResult* result);

}  // namespace mvstudio::cli
