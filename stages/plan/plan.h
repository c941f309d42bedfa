#pragma once

#include <cmath>
#include <map>
#include <string>
#include <vector>

#include "stages/pipeline/record.h"

/// A session's stages as tasks that any scheduler can do, each by `mvstudio task PLAN K`.
namespace mvstudio::stages {

struct PlanTask {
  int id = 0;  ///< from 1; tasks of one kind of stage are numbered in a row, and each comes after those that it waits for
  PipelineStage stage;     ///< paths are absolute
  std::vector<int> after;  ///< ids of those whose outputs it reads
  /// What no task makes, as it was when the plan was written: nothing of it may change until the plan is done.
  std::vector<Fingerprint> inputs;
  double seconds = NAN;  ///< as long as it took last time, else as foretold for one thread; NaN: neither is known
};

/// A part of a stage as a task.
struct PartTask {
  PipelineStage stage;
  double seconds = NAN;  ///< as foretold
};
/// By PipelineStage::name() of the stage: its parts, level by level.
using PartsByStage = std::map<std::string, std::vector<std::vector<PartTask>>>;

struct Plan {
  std::string folder;  ///< absolute
  std::string session, version;
  std::vector<std::string> accept;  ///< codes of errors that do not stop it
  std::vector<PlanTask> tasks;
};

/// A task for each of `chosen`, whose names were given paths from `options.session`, and before it those of its parts: each
/// level of parts waits for the one before, the stage for the last. `earlier`: of SESSION/run.json, for the seconds.
Plan PlanOf(const PipelineOptions& options, std::vector<const PipelineStage*> chosen, const StageRecords& earlier,
            const PartsByStage& parts = {});

/// PLAN/kept: what the parts keep for their stages. Machines share it.
std::string KeptFolder(const std::string& plan);
/// Whether other tasks make parts of this stage.
bool HasParts(const Plan& plan, const PlanTask& task);

/// PLAN/plan.jsonl: one line for the plan, one for each task.
std::string PlanText(const Plan& plan);
/// Throws FormatError, IoError.
Plan ReadPlan(const std::string& folder);
/// Throws UsageError for a number that is none of the plan's.
const PlanTask& TaskOf(const Plan& plan, int id);

/// PLAN/done/K.json: that a task is done, written last. PLAN/tried/K.json: how its last try began or ended.
std::string MarkerPath(const Plan& plan, const PlanTask& task);
std::string TriedPath(const Plan& plan, const PlanTask& task);

/// What a marker or a record of a try says; none where it is missing, no record, or of another task.
std::optional<StageRecord> ReadTaskRecord(const std::string& path, const PlanTask& task);

enum class TaskState {
  kDone,
  kFailed,    ///< its last try ended with an exit code
  kBegun,     ///< runs, or was interrupted
  kWaiting,   ///< for others
  kReady,     ///< nothing to wait for
  kNotValid,  ///< it has a marker, but its inputs, its flags or its output are others by now
};
std::string_view ToString(TaskState state);

/// From the markers, and from names, sizes and times of the files that they name; a file is read only where these changed. No
/// scheduler is asked.
std::vector<TaskState> StatesOf(const Plan& plan);

/// Ids of the tasks that are not done, and of those that wait for one: what these read may change.
std::vector<int> RemainingTasks(const Plan& plan, const std::vector<TaskState>& states);

}  // namespace mvstudio::stages
