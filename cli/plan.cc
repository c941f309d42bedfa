#include <algorithm>
#include <filesystem>
#include <map>

#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "cli/stage_run.h"
#include "core/disk/files.h"
#include "core/disk/manifest.h"
#include "core/disk/output.h"
#include "core/format.h"
#include "core/join.h"
#include "core/process.h"
#include "core/text/shell_word.h"
#include "stages/pipeline/engines.h"
#include "stages/pipeline/need.h"
#include "stages/report_fields.h"

namespace mvstudio::cli {
namespace fs = std::filesystem;
namespace {

using stages::Engine;
using stages::Plan;
using stages::PlanTask;
using stages::TaskState;

struct PlanOptions {
  stages::PipelineOptions pipeline;
  std::string out;
  std::vector<Engine> write = {Engine::kNinja};
  stages::EngineOptions engine;
};

/// This program by its path, for schedulers that have another PATH.
std::string ProgramPath() { return fs::read_symlink("/proc/self/exe").string(); }

std::vector<int> AllTasks(const Plan& plan) {
  std::vector<int> ids;
  for (const PlanTask& task : plan.tasks) ids.push_back(task.id);
  return ids;
}

std::string TaskTable(const Plan& plan) {
  std::string text;
  double seconds = 0;
  for (const PlanTask& task : plan.tasks) {
    const std::string after =
        task.after.empty() ? "" : "after " + Join(task.after, ", ", [](int id) { return std::to_string(id); });
    const std::string time = std::isfinite(task.seconds) ? Format("%.1f s", task.seconds) : "";
    text += Format("%4d  %-24s %10s %s %s\n", task.id, task.stage.name().c_str(), time.c_str(),
                   NeedText(task.stage.need).c_str(), after.c_str());
    if (std::isfinite(task.seconds)) seconds += task.seconds;
  }
  if (seconds > 0) text += Format("about %.0f s of work, as long as it took last time\n", seconds);
  return text;
}

CommandResult RunPlan(PlanOptions options) {
  stages::PipelineOptions& pipeline = options.pipeline;
  std::vector<std::string> names = {"plan.jsonl"};
  for (const Engine engine : options.write) names.push_back(stages::EngineFile(engine));
  const std::string session_file = pipeline.session + "/mvstudio.toml";
  if (fs::exists(session_file)) pipeline.session = fs::canonical(pipeline.session).string();
  const dataset::Session session = dataset::ReadSession(pipeline.session, pipeline.allow_outside);
  std::vector<PipelineStage> stages = stages::PipelineOf(session, pipeline);
  stages::PredictNeeds(session, pipeline, &stages);
  Plan plan = stages::PlanOf(pipeline, stages, stages::ReadStageRecords(pipeline.session + "/run.json"));
  if (plan.tasks.empty())
    throw UsageError("nothing of this session is asked for: see `mvstudio run " + ShellWord(pipeline.session) + " --dry-run`");
  const OutputFolder place(options.out, {session_file}, names);
  MakeFolder(options.out);
  plan.folder = fs::canonical(options.out).string();
  plan.version = MVSTUDIO_VERSION;
  options.engine.program = ProgramPath();
  CommandResult result;
  FilesTogether files;
  WriteFileAtomic(options.out + "/plan.jsonl", stages::PlanText(plan));
  result.outputs.push_back({options.out + "/plan.jsonl", "plan"});
  for (const Engine engine : options.write) {
    const std::string path = options.out + "/" + stages::EngineFile(engine);
    WriteFileAtomic(path, stages::EngineText(engine, plan, AllTasks(plan), options.engine));
    result.outputs.push_back({path, "plan"});
  }
  files.Commit();
  for (const std::string& warning : session.warnings) result.warnings.push_back({"SES-FILE", warning, ""});
  result.metrics["num_tasks"] = plan.tasks.size();
  result.inputs = {session_file};
  result.folder = options.out;
  result.text = TaskTable(plan);
  return result;
}

/// Inputs that no task makes are what they were when the plan was written.
void RequireSameInputs(const PlanTask& task) {
  for (const stages::Fingerprint& planned : task.inputs) {
    const stages::Fingerprint now = stages::FingerprintOf(planned.path, &planned);
    if (now.files == 0 && planned.files == 0) continue;
    if (!now.SameAs(planned)) {
      throw FormatError(planned.path, "",
                        "is not what it was when the plan was written; write the plan anew by `mvstudio plan`: what is "
                        "done and did not change is kept");
    }
  }
}

void RequireDone(const Plan& plan, const PlanTask& task) {
  for (const int id : task.after) {
    const PlanTask& earlier = stages::TaskOf(plan, id);
    const auto marker = stages::ReadTaskRecord(MarkerPath(plan, earlier), earlier);
    if (marker && stages::IsSettled(earlier.stage, *marker)) continue;
    if (task.stage.kind == StageKind::kReport) continue;  // shows what failed
    throw UsageError("task " + std::to_string(task.id) + " (" + task.stage.name() + ") reads what task " + std::to_string(id) +
                     " (" + earlier.stage.name() + ") writes, and that has no marker yet: do that first");
  }
}

struct TaskOptions {
  std::string plan;
  int task = 0;
  bool again = false;
};

class TaskRun {
 public:
  TaskRun(const TaskOptions& options, CommandContext& context)
      : options_(options),
        context_(context),
        plan_(stages::ReadPlan(options.plan)),
        task_(stages::TaskOf(plan_, options.task)) {}

  CommandResult Run() {
    RequireDone(plan_, task_);
    RequireSameInputs(task_);
    const OutputLock lock(TriedPath(plan_, task_));
    std::optional<StageRecord> earlier = ReadTaskRecord(TriedPath(plan_, task_), task_);
    if (!earlier) earlier = ReadTaskRecord(MarkerPath(plan_, task_), task_);
    StageRecord now = stages::RecordOf(task_.stage, MVSTUDIO_VERSION, earlier ? &*earlier : nullptr);
    row_.stage = task_.stage.name();
    row_.command = "mvstudio " + Join(task_.stage.Words("--"), " ");
    row_.reason = stages::WhyStale(task_.stage, now, earlier ? &*earlier : nullptr);
    if (row_.reason.empty() && !stages::IsSameOutput(now.output, *earlier)) row_.reason = "its output was changed by others";
    if (!earlier && stages::IsNewerThanInputs(task_.stage) && !options_.again) return Found(std::move(now));
    if (row_.reason.empty() && !options_.again) return UpToDate(*earlier);
    return Do(std::move(now), earlier);
  }

 private:
  CommandResult UpToDate(const StageRecord& earlier) {
    row_.state = RowState::kUpToDate;
    const std::optional<StageRecord> marker = stages::ReadTaskRecord(MarkerPath(plan_, task_), task_);
    if (!marker || !stages::IsSameOutput(marker->output, earlier)) Mark(earlier);
    return Say({});
  }

  CommandResult Found(StageRecord now) {
    now.found = true;
    row_.state = RowState::kUpToDate, row_.reason = "found, newer than what it is made of";
    Keep(&now);
    Mark(now);
    return Say({});
  }

  CommandResult Do(StageRecord now, const std::optional<StageRecord>& earlier) {
    const StageKeeper keep = [&](const StageRecord* record) { Keep(record); };
    Unmark();
    CommandResult done = DoStage(task_.stage, std::move(now), earlier ? &*earlier : nullptr, {plan_.accept, options_.again},
                                 keep, context_, &row_);
    if (row_.state != RowState::kFailed && kept_) Mark(*kept_);
    return Say(std::move(done));
  }

  /// What a scheduler is told: 0 when there is a marker, 75 when it may be tried again.
  CommandResult Say(CommandResult done) {
    CommandResult result;
    result.warnings = std::move(done.warnings);
    const bool failed = row_.state == RowState::kFailed;
    Append(done.errors, failed ? &result.errors : &result.warnings);
    if (failed) result.exit = done.exit == kExitInterrupted ? static_cast<int>(kExitTryAgain) : done.exit;
    result.metrics["task"] = task_.id;
    result.metrics["stages"] = stages::RowsJson(std::vector<StageRow>{row_});
    result.text = row_.stage + ": " + std::string(ToString(row_.state)) + (row_.reason.empty() ? "" : " (" + row_.reason + ")");
    return result;
  }

  void Keep(const StageRecord* record) {
    kept_ = record ? std::optional<StageRecord>(*record) : std::nullopt;
    stages::StageRecords records;
    if (record) records[task_.stage.name()] = *record;
    stages::WriteStageRecords(TriedPath(plan_, task_), records);
  }

  void Mark(const StageRecord& record) { stages::WriteStageRecords(MarkerPath(plan_, task_), {{task_.stage.name(), record}}); }
  void Unmark() {
    if (fs::exists(MarkerPath(plan_, task_))) RemoveOurs({MarkerPath(plan_, task_)});
  }

  const TaskOptions options_;
  CommandContext& context_;
  const Plan plan_;
  const PlanTask& task_;
  StageRow row_;
  std::optional<StageRecord> kept_;
};

struct JobsOptions {
  std::string plan;
  Engine engine = Engine::kNinja;
  int jobs = 0;
  stages::EngineOptions limits;
};

/// Rows of the table of `jobs status`: a stage each.
CommandResult Status(const Plan& plan) {
  const std::vector<TaskState> states = stages::StatesOf(plan);
  std::map<TaskState, int> all;
  std::map<StageKind, std::map<TaskState, int>> by_stage;
  CommandResult result;
  result.metrics["tasks"] = nlohmann::ordered_json::array();
  for (size_t i = 0; i < states.size(); ++i) {
    const PlanTask& task = plan.tasks[i];
    ++all[states[i]], ++by_stage[task.stage.kind][states[i]];
    result.metrics["tasks"].push_back({{"id", task.id}, {"stage", task.stage.name()}, {"state", ToString(states[i])}});
    if (states[i] != TaskState::kFailed) continue;
    const int exit = ReadTaskRecord(TriedPath(plan, task), task)->exit;
    result.errors.push_back(
        {"JOB-FAILED",
         "task " + std::to_string(task.id) + " (" + task.stage.name() + ") ended with exit code " + std::to_string(exit),
         "its message again: mvstudio task " + ShellWord(plan.folder) + " " + std::to_string(task.id)});
    if (result.exit == kExitOk) result.exit = exit;
  }
  for (const auto& [kind, counts] : by_stage) {
    result.text +=
        Format("%-12s ", std::string(ToString(kind)).c_str()) +
        Join(counts, ", ",
             [](const auto& count) { return std::to_string(count.second) + " " + std::string(ToString(count.first)); }) +
        "\n";
  }
  result.text += Format("%d of %d tasks are done\n", all[TaskState::kDone], static_cast<int>(states.size()));
  result.metrics["num_done"] = all[TaskState::kDone];
  if (result.exit == kExitOk && all[TaskState::kDone] < static_cast<int>(states.size())) result.partial = true;
  return result;
}

/// Hands what has no valid marker to the scheduler.
CommandResult Submit(JobsOptions options, CommandContext& context) {
  const Plan plan = stages::ReadPlan(options.plan);
  const std::vector<TaskState> states = stages::StatesOf(plan);
  const std::vector<int> ids = RemainingTasks(plan, states);
  if (ids.empty()) return Status(plan);
  if (options.engine == Engine::kSnakemake)
    throw UsageError("option 'engine' snakemake: call snakemake itself, -s " + ShellWord(plan.folder + "/Snakefile"));
  options.limits.program = ProgramPath();
  for (const int id : ids) {  // a scheduler looks at names alone: a marker that does not hold would keep the task back
    const std::string marker = MarkerPath(plan, stages::TaskOf(plan, id));
    if (states[static_cast<size_t>(id - 1)] != TaskState::kDone && fs::exists(marker)) RemoveOurs({marker});
  }
  const std::string file = plan.folder + "/" + stages::EngineFile(options.engine), log = plan.folder + "/submit.log";
  WriteFileAtomic(file, EngineText(options.engine, plan, ids, options.limits));
  std::vector<std::string> words = {"sh", file};
  if (options.engine == Engine::kNinja) {
    words = {"ninja", "-f", file, "-k", "0"};
    if (options.jobs > 0) words.insert(words.end(), {"-j", std::to_string(options.jobs)});
  }
  ProgressStage progress(context.run, "tasks", static_cast<int64_t>(ids.size()));
  int64_t seen = 0;
  const auto poll = [&] {
    const int64_t done =
        std::count_if(ids.begin(), ids.end(), [&](int id) { return fs::exists(MarkerPath(plan, stages::TaskOf(plan, id))); });
    progress.Advance(std::max<int64_t>(0, done - seen), "");
    seen = std::max(seen, done);
  };
  WriteFileAtomic(log, [&](const std::string& temporary) { RunProcess(words, {temporary, "", false, ""}, poll); });
  if (options.engine == Engine::kNinja) return Status(plan);
  CommandResult result;
  result.text = ReadFile(log);
  result.metrics["num_submitted"] = ids.size();
  return result;
}

}  // namespace

void RegisterPlan(CLI::App& app, Registry& registry) {
  auto options = std::make_shared<PlanOptions>();
  CLI::App* sub = app.add_subcommand("plan", "The stages of a session as tasks for a scheduler: ninja, Slurm, Snakemake");
  AddOption(sub, "session", options->pipeline.session, "the session's folder")->required();
  AddOutput(sub, "--out", options->out, OutputKind::kFolder, "folder of the plan")->required();
  VisitStageChoice(OptionAdder{sub}, options->pipeline);
  OptionAdder{sub}.StartGroup("Schedulers");
  AddChoices(sub, "--write", options->write, "schedulers to write files for: ninja, slurm, snakemake")->capture_default_str();
  VisitFields(OptionAdder{sub}, options->engine);
  registry.Add(sub, "plan", [options](CommandContext&) { return RunPlan(*options); });
}

void RegisterTask(CLI::App& app, Registry& registry) {
  auto options = std::make_shared<TaskOptions>();
  CLI::App* sub = app.add_subcommand("task", "Do one task of a plan, unless it is done");
  AddOption(sub, "plan", options->plan, "folder of the plan")->required();
  AddOption(sub, "task", options->task, "number of the task")->required();
  AddFlag(sub, "--again", options->again, "do it again, also what others made");
  registry.Add(sub, "task", [options](CommandContext& context) { return TaskRun(*options, context).Run(); });
}

void RegisterJobs(CLI::App& app, Registry& registry) {
  CLI::App* jobs = app.add_subcommand("jobs", "Give the tasks of a plan to a scheduler, and see what is done");
  jobs->require_subcommand(1);
  auto options = std::make_shared<JobsOptions>();
  const auto add = [&](const std::string& name, const std::string& help) {
    CLI::App* sub = jobs->add_subcommand(name, help);
    AddOption(sub, "plan", options->plan, "folder of the plan")->required();
    return sub;
  };
  for (const char* name : {"submit", "retry"}) {
    const bool first = std::string(name) == "submit";
    CLI::App* sub =
        add(name, first ? "Give the tasks to a scheduler" : "Give the tasks that have no valid marker to a scheduler again");
    AddChoice(sub, "--engine", options->engine, "ninja: here, until all are done; slurm: sbatch")->capture_default_str();
    AddOption(sub, "--jobs", options->jobs, "ninja: tasks at a time; 0: ninja's own choice")->capture_default_str();
    VisitFields(OptionAdder{sub}, options->limits);
    registry.Add(sub, std::string("jobs ") + name, [options](CommandContext& context) { return Submit(*options, context); });
  }
  registry.Add(add("status", "What is done, by the markers alone"), "jobs status",
               [options](CommandContext&) { return Status(stages::ReadPlan(options->plan)); });
}

}  // namespace mvstudio::cli
