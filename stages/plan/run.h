#pragma once

#include <string>
#include <utility>
#include <vector>

#include "core/progress.h"
#include "stages/pipeline/run.h"
#include "stages/plan/options.h"
#include "stages/plan/plan.h"

/// Plans written, their tasks done, and given to a scheduler.
namespace mvstudio::stages {

struct PlanReport {
  std::string folder, session_file;
  Plan plan;
  std::vector<std::string> outputs;  ///< paths
  std::vector<Notice> warnings;
};

/// Writes plan.jsonl and the schedulers' files for the stages that a dry run of `run` would do, and for those that others made:
/// their tasks find them. There may be none. Throws UsageError where none of the stages is asked for and needed, and where
/// something is there already.
PlanReport WritePlan(PlanOptions options, const PipelineTools& tools);

struct TaskReport {
  int task = 0;
  StageRow row;
  StageWords said;
};

/// One task, unless it is done. Throws UsageError where it waits for others, FormatError where an input that no task makes is
/// not what it was when the plan was written, LockedError where another process does it and `options.wait` is off or `run` is
/// cancelled.
TaskReport RunTask(const TaskOptions& options, const PipelineTools& tools, const RunContext& run = {});

struct TaskRow {
  int id = 0;
  std::string stage;
  TaskState state = TaskState::kReady;
};

template <class Visitor>
void VisitFields(Visitor&& visit, const TaskRow& row) {
  visit("id", row.id);
  visit("stage", row.stage);
  visit("state", row.state);
}

struct JobsReport {
  std::vector<StageKind> kinds;  ///< one a row
  std::vector<TaskRow> rows;
  std::vector<Notice> errors;  ///< one a task that failed
  int exit = 0;                ///< of the first of them
  size_t num_submitted = 0;
  std::string said;  ///< by the scheduler that has them now; the rest is empty then
};

/// What is done, by the markers alone.
JobsReport JobsStatus(const std::string& folder);

/// Hands what has no valid marker to the scheduler; ninja: returns when all are done or one failed.
JobsReport SubmitJobs(JobsOptions options, const RunContext& run);

}  // namespace mvstudio::stages
