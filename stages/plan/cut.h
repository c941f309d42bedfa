#pragma once

#include <string>
#include <vector>

#include "stages/plan/options.h"
#include "stages/plan/plan.h"

namespace mvstudio::stages {

/// Parts of `pose2d`, `mask`, `dataset` and `verify` of takes: by cameras, and where a camera takes longer than `task_seconds`, by blocks of frames.
/// Each keeps its result in KeptFolder(`folder`) and lists it in PLAN/parts. A stage that is foretold to take at most twice as
/// long as a task has none; neither has one that chooses settings by a budget, or whose cache, output or part is given.
/// `folder`: of the plan, absolute.
PartsByStage CutStages(const PlanOptions& options, const std::vector<const PipelineStage*>& chosen, const StageRecords& earlier,
                       const std::string& folder);

}  // namespace mvstudio::stages
