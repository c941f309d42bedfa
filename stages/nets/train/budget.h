// Private: for run.cc.
#pragma once

#include <memory>

#include "dataset/panoptic/panoptic.h"
#include "stages/budget/report.h"
#include "stages/nets/train/method.h"

/// The kind of avatar that a budget or a target pays for.
namespace mvstudio::stages {

/// What it cannot be must not cost the run. Throws UsageError.
void CheckAvatarBudget(const AvatarTrainOptions& options);

/// Where nothing judges yet, a training camera is left out for it, which is said. Throws UsageError where there is none.
void LeaveJudgeOut(const dataset::PanopticDataset& data, AvatarTrainOptions* options);

/// Throws UsageError where a few time steps foretell that fitting the body alone takes more than the budget. `started_s`: of
/// the clock, when the command began.
void RequireTimeToFit(const dataset::PanopticDataset& data, const avatar::RunConfig& config, const AvatarTrainOptions& options,
                      double started_s, const RunContext& run);

/// Trains the fitted body's colours, Gaussians and networks briefly on part of the images, and sets method and steps of
/// `options` where nobody gave them (steps that were given become 0 where the body alone is chosen): of what is not shown to be
/// worse on the validation images the simplest. Throws UsageError for a budget that not even the body keeps, and what making
/// the methods does where none can be made.
BudgetReport ChooseAvatar(const dataset::PanopticDataset& data, const avatar::RunConfig& config, double started_s,
                          const RunContext& run, AvatarTrainOptions* options);

/// What came of it, in the result and in the folder of the run.
void KeepAvatarBudget(double started_s, AvatarTrainReport* report);

}  // namespace mvstudio::stages
