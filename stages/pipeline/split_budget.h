#pragma once

#include <cmath>
#include <string>
#include <vector>

#include "stages/pipeline/pipeline.h"

/// The time of several stages, split among those that can make do with less.
namespace mvstudio::stages {

/// A stage that is to be done.
struct StageTime {
  StageKind kind = StageKind::kCalibrate;
  std::string name;             ///< as PipelineStage::name()
  double seconds = NAN;         ///< as long as it took last time; NaN: never measured
  bool has_own_budget = false;  ///< one that was given to it alone, which `seconds` then is
};

/// Whether the command of a stage takes option 'budget'.
bool TakesBudget(StageKind kind);
/// Among the options of the stage.
bool HasOwnBudget(const PipelineStage& stage);

/// Seconds of the first of `to_do`, NaN where it takes no budget of `run`'s, when `left_s` are left for all. Stages without a
/// budget get what they took last time, or a few seconds where they are quick. The others share the rest as they shared the
/// time before, or, where one of them was never measured, as a session of a few minutes does. `asked`: the budget as it was
/// given, for messages. Throws UsageError where a slow stage was never measured, and where nothing is left.
double StageBudget(const std::vector<StageTime>& to_do, double left_s, const std::string& asked);

}  // namespace mvstudio::stages
