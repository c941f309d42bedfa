#pragma once

#include "stages/plan/run.h"

namespace mvstudio::stages {

/// The tasks with their seconds and needs.
CommandResult Describe(const PlanReport& report);

/// What a scheduler is told: 0 when there is a marker, 75 when it may be tried again.
CommandResult Describe(const TaskReport& report);

/// A row for each kind of stage.
CommandResult Describe(const JobsReport& report);

}  // namespace mvstudio::stages
