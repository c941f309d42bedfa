#include <algorithm>
#include <filesystem>

#include "core/disk/files.h"
#include "core/disk/manifest.h"
#include "core/error.h"
#include "core/process.h"
#include "core/text/shell_word.h"
#include "stages/plan/engines.h"
#include "stages/plan/run.h"

namespace mvstudio::stages {
namespace fs = std::filesystem;
namespace {

Notice FailureOf(const Plan& plan, const PlanTask& task, int exit) {
  return {"JOB-FAILED",
          "task " + std::to_string(task.id) + " (" + task.stage.name() + ") ended with exit code " + std::to_string(exit),
          "its message again: mvstudio task " + ShellWord(plan.folder) + " " + std::to_string(task.id)};
}

JobsReport StatusOf(const Plan& plan) {
  const std::vector<TaskState> states = StatesOf(plan);
  JobsReport report;
  for (size_t i = 0; i < states.size(); ++i) {
    const PlanTask& task = plan.tasks[i];
    report.kinds.push_back(task.stage.kind);
    report.rows.push_back({task.id, task.stage.name(), states[i]});
    if (states[i] != TaskState::kFailed) continue;
    const int exit = ReadTaskRecord(TriedPath(plan, task), task)->exit;
    report.errors.push_back(FailureOf(plan, task, exit));
    if (report.exit == kExitOk) report.exit = exit;
  }
  return report;
}

/// A scheduler looks at names alone: a marker that does not hold would keep the task back.
void RemoveInvalidMarkers(const Plan& plan, const std::vector<TaskState>& states, const std::vector<int>& ids) {
  for (const int id : ids) {
    const std::string marker = MarkerPath(plan, TaskOf(plan, id));
    if (states[static_cast<size_t>(id - 1)] != TaskState::kDone && fs::exists(marker)) RemoveOurs({marker});
  }
}

std::vector<std::string> SchedulerWords(const JobsOptions& options, const std::string& file) {
  if (options.engine != Engine::kNinja) return {"sh", file};
  std::vector<std::string> words = {"ninja", "-f", file, "-k", "0"};
  if (options.jobs > 0) words.insert(words.end(), {"-j", std::to_string(options.jobs)});
  return words;
}

/// What the scheduler prints stands in `log`; progress is told by the markers.
void RunScheduler(const Plan& plan, const std::vector<int>& ids, const std::vector<std::string>& words, const std::string& log,
                  const RunContext& run) {
  ProgressStage progress(run, "tasks", static_cast<int64_t>(ids.size()));
  int64_t seen = 0;
  const auto poll = [&] {
    const int64_t done =
        std::count_if(ids.begin(), ids.end(), [&](int id) { return fs::exists(MarkerPath(plan, TaskOf(plan, id))); });
    progress.Advance(std::max<int64_t>(0, done - seen), "");
    seen = std::max(seen, done);
  };
  WriteFileAtomic(log, [&](const std::string& temporary) { RunProcess(words, {temporary, "", false, ""}, poll); });
}

}  // namespace

JobsReport JobsStatus(const std::string& folder) { return StatusOf(ReadPlan(folder)); }

JobsReport SubmitJobs(JobsOptions options, const RunContext& run) {
  const Plan plan = ReadPlan(options.plan);
  const std::vector<TaskState> states = StatesOf(plan);
  const std::vector<int> ids = RemainingTasks(plan, states);
  if (ids.empty()) return StatusOf(plan);
  if (options.engine == Engine::kSnakemake)
    throw UsageError("option 'engine' snakemake: call snakemake itself, -s " + ShellWord(plan.folder + "/Snakefile"));
  options.limits.program = ProgramPath();
  RemoveInvalidMarkers(plan, states, ids);
  const std::string file = plan.folder + "/" + EngineFile(options.engine), log = plan.folder + "/submit.log";
  WriteFileAtomic(file, EngineText(options.engine, plan, ids, options.limits));
  RunScheduler(plan, ids, SchedulerWords(options, file), log, run);
  if (options.engine == Engine::kNinja) return StatusOf(plan);
  JobsReport report;
  report.num_submitted = ids.size();
  report.said = ReadFile(log);
  return report;
}

}  // namespace mvstudio::stages
