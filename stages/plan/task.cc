#include <chrono>
#include <filesystem>
#include <optional>
#include <thread>

#include "core/disk/lock.h"
#include "core/disk/manifest.h"
#include "core/error.h"
#include "stages/plan/run.h"

namespace mvstudio::stages {
namespace fs = std::filesystem;
namespace {

/// Inputs that no task makes are what they were when the plan was written.
void RequireSameInputs(const PlanTask& task) {
  for (const Fingerprint& planned : task.inputs) {
    const Fingerprint now = FingerprintOf(planned.path, &planned);
    if (now.files == 0 && planned.files == 0) continue;
    if (!now.SameAs(planned)) {
      throw FormatError(planned.path, "",
                        "is not what it was when the plan was written; write the plan anew by `mvstudio plan`: what is "
                        "done and did not change is kept");
    }
  }
}

/// Slurm starts a task twice when its controller was killed: both end well where the second waits for the first.
void LockTask(const std::string& path, bool wait, const RunContext& run, std::optional<OutputLock>* lock) {
  while (!*lock) {
    try {
      lock->emplace(path);
    } catch (const LockedError&) {
      if (!wait || (run.progress && run.progress->Cancelled())) throw;
      std::this_thread::sleep_for(std::chrono::milliseconds(200));
    }
  }
}

void RequireDone(const Plan& plan, const PlanTask& task) {
  for (const int id : task.after) {
    const PlanTask& earlier = TaskOf(plan, id);
    const auto marker = ReadTaskRecord(MarkerPath(plan, earlier), earlier);
    if (marker && IsSettled(earlier.stage, *marker)) continue;
    if (task.stage.kind == StageKind::kReport) continue;  // shows what failed
    throw UsageError("task " + std::to_string(task.id) + " (" + task.stage.name() + ") reads what task " + std::to_string(id) +
                     " (" + earlier.stage.name() + ") writes, and that has no marker yet: do that first");
  }
}

class TaskRun {
 public:
  TaskRun(const TaskOptions& options, const PipelineTools& tools, const RunContext& run)
      : options_(options), tools_(tools), run_(run), plan_(ReadPlan(options.plan)), task_(TaskOf(plan_, options.task)) {
    report_.task = task_.id;
    row_.stage = task_.stage.name();
    row_.command = task_.stage.line().Text();
  }

  TaskReport Run() {
    RequireDone(plan_, task_);
    RequireSameInputs(task_);
    std::optional<OutputLock> lock;
    LockTask(TriedPath(plan_, task_), options_.wait, run_, &lock);
    std::optional<StageRecord> earlier = ReadTaskRecord(TriedPath(plan_, task_), task_);
    if (!earlier) earlier = ReadTaskRecord(MarkerPath(plan_, task_), task_);
    Judgement judged = JudgeStage(task_.stage, tools_.version, earlier ? &*earlier : nullptr);
    row_.reason = judged.stale;
    if (row_.reason.empty() && !IsSameOutput(judged.now.output, *earlier)) row_.reason = "its output was changed by others";
    if (judged.now.found && !options_.again) {
      Found(std::move(judged.now));
    } else if (row_.reason.empty() && !options_.again) {
      UpToDate(*earlier);
    } else {
      Do(std::move(judged.now), earlier);
    }
    return std::move(report_);
  }

 private:
  void UpToDate(const StageRecord& earlier) {
    row_.state = RowState::kUpToDate;
    const std::optional<StageRecord> marker = ReadTaskRecord(MarkerPath(plan_, task_), task_);
    if (!marker || !IsSameOutput(marker->output, earlier)) Mark(earlier);
  }

  void Found(StageRecord now) {
    row_.state = RowState::kUpToDate, row_.found = true;
    Keep(&now);
    Mark(now);
  }

  void Do(StageRecord now, const std::optional<StageRecord>& earlier) {
    const StageKeeper keep = [&](const StageRecord* record) { Keep(record); };
    if (fs::exists(MarkerPath(plan_, task_))) RemoveOurs({MarkerPath(plan_, task_)});
    now.found = false;
    report_.said = DoStage(WithKept(), std::move(now), earlier ? &*earlier : nullptr, {plan_.accept, options_.again}, keep,
                           tools_.call, &row_);
    if (row_.state != RowState::kFailed && kept_) Mark(*kept_);
  }

  /// The stage finds what its parts kept; its record knows nothing of it.
  PipelineStage WithKept() const {
    PipelineStage stage = task_.stage;
    if (HasParts(plan_, task_)) stage.options.push_back({"cache", {KeptFolder(plan_.folder)}});
    return stage;
  }

  void Keep(const StageRecord* record) {
    kept_ = record ? std::optional<StageRecord>(*record) : std::nullopt;
    StageRecords records;
    if (record) records[task_.stage.name()] = *record;
    WriteStageRecords(TriedPath(plan_, task_), records);
  }

  void Mark(const StageRecord& record) { WriteStageRecords(MarkerPath(plan_, task_), {{task_.stage.name(), record}}); }

  const TaskOptions& options_;
  const PipelineTools& tools_;
  const RunContext& run_;
  const Plan plan_;
  const PlanTask& task_;
  TaskReport report_;
  StageRow& row_ = report_.row;
  std::optional<StageRecord> kept_;
};

}  // namespace

TaskReport RunTask(const TaskOptions& options, const PipelineTools& tools, const RunContext& run) {
  return TaskRun(options, tools, run).Run();
}

}  // namespace mvstudio::stages
