#include "stages/plan/plan.h"

#include <algorithm>
#include <filesystem>
#include <set>
#include <sstream>

#include "core/disk/files.h"
#include "core/disk/paths.h"
#include "core/error.h"

namespace mvstudio::stages {
namespace fs = std::filesystem;
namespace {

using PlanJson = nlohmann::ordered_json;

constexpr char kPlanSchema[] = "mvstudio.plan/1";
constexpr ChoiceWords<TaskState, 6> kTaskStateWords = {{{TaskState::kDone, "done"},
                                                        {TaskState::kFailed, "failed"},
                                                        {TaskState::kBegun, "running or interrupted"},
                                                        {TaskState::kWaiting, "waiting"},
                                                        {TaskState::kReady, "ready"},
                                                        {TaskState::kNotValid, "done for other files"}}};

std::string PlanPath(const std::string& folder) { return folder + "/plan.jsonl"; }

bool MadeByAny(const std::vector<const PipelineStage*>& makers, const std::string& input) {
  PipelineStage reader;
  reader.inputs = {input};
  return std::any_of(makers.begin(), makers.end(), [&](const PipelineStage* maker) { return Reads(reader, *maker); });
}

PlanJson OrNull(double value) { return std::isfinite(value) ? PlanJson(value) : PlanJson(nullptr); }

/// NaN where it is null, or missing as in plans of earlier versions.
double OrNan(const PlanJson& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_number() ? found->get<double>() : NAN;
}

PlanJson TaskJson(const PlanTask& task) {
  PlanJson json = {{"id", task.id},
                   {"stage", ToString(task.stage.kind)},
                   {"take", task.stage.take},
                   {"part", task.stage.part},
                   {"command", task.stage.command},
                   {"options", PlanJson::array()},
                   {"reads", task.stage.inputs},
                   {"output", task.stage.output},
                   {"after", task.after},
                   {"may_fail", task.stage.may_fail},
                   {"seconds", OrNull(task.seconds)},
                   {"memory_mb", OrNull(task.stage.need.memory_mb)},
                   {"disk_mb", OrNull(task.stage.need.disk_mb)}};
  for (const LineOption& option : task.stage.options)
    json["options"].push_back({{"name", option.name}, {"values", option.values}});
  json["inputs"] = PlanJson::array();
  for (const Fingerprint& input : task.inputs) json["inputs"].push_back(PrintJson(input));
  return json;
}

PlanTask TaskFrom(const PlanJson& json, const std::string& session) {
  PlanTask task;
  task.stage.session = session;
  task.id = json.at("id").get<int>();
  FromString(json.at("stage").get<std::string>(), &task.stage.kind);
  task.stage.take = json.at("take").get<std::string>();
  task.stage.part = json.value("part", "");
  task.stage.command = json.at("command").get<std::vector<std::string>>();
  for (const PlanJson& option : json.at("options"))
    task.stage.options.push_back({option.at("name").get<std::string>(), option.at("values").get<std::vector<std::string>>()});
  task.stage.inputs = json.at("reads").get<std::vector<std::string>>();
  task.stage.output = json.at("output").get<std::string>();
  task.stage.may_fail = json.at("may_fail").get<bool>();
  task.after = json.at("after").get<std::vector<int>>();
  task.seconds = OrNan(json, "seconds");
  task.stage.need = {OrNan(json, "memory_mb"), OrNan(json, "disk_mb")};
  for (const PlanJson& input : json.at("inputs")) task.inputs.push_back(PrintFrom(input));
  return task;
}

/// `pose2d` chooses its net by the calibration, where there is one.
bool ChoosesNet(const PipelineStage& stage) {
  const auto names_it = [](const LineOption& option) { return option.name == "backend"; };
  return stage.kind == StageKind::kPose2d && std::none_of(stage.options.begin(), stage.options.end(), names_it);
}

/// Stages in their order as tasks, each after those of its parts.
class PlanMaker {
 public:
  PlanMaker(const std::vector<const PipelineStage*>& chosen, const StageRecords& earlier, const PartsByStage& parts)
      : chosen_(chosen), earlier_(earlier), parts_(parts) {}

  Plan Make() {
    for (size_t first = 0, end = 0; first < chosen_.size(); first = end) {
      while (end < chosen_.size() && chosen_[end]->kind == chosen_[first]->kind) ++end;
      AddKind(first, end);
    }
    return std::move(plan_);
  }

 private:
  /// Tasks of one kind and level stand in a row.
  void AddKind(size_t first, size_t end) {
    std::map<std::string, std::vector<int>> before;  // by stage: its parts of the level before
    bool more = true;
    for (size_t level = 0; more; ++level) {
      more = false;
      for (size_t i = first; i < end; ++i) {
        const auto found = parts_.find(chosen_[i]->name());
        if (found == parts_.end() || level >= found->second.size()) continue;
        more = true;
        std::vector<int> ids;
        for (const PartTask& part : found->second[level])
          ids.push_back(Add(part.stage, part.seconds, level == 0 ? After(*chosen_[i]) : before[chosen_[i]->name()]));
        before[chosen_[i]->name()] = ids;
      }
    }
    for (size_t i = first; i < end; ++i) {
      std::vector<int> after = After(*chosen_[i]);
      const std::vector<int>& own = before[chosen_[i]->name()];
      after.insert(after.end(), own.begin(), own.end());
      const auto last = earlier_.find(chosen_[i]->name());
      const double measured = SecondsOf(last == earlier_.end() ? nullptr : &last->second);
      const double seconds = std::isfinite(measured) ? measured : chosen_[i]->need.seconds;
      Add(*chosen_[i], own.empty() ? seconds : NAN, std::move(after));  // putting parts together was never measured
    }
  }

  /// Ids of those whose outputs the stage reads, or looks at to choose.
  std::vector<int> After(const PipelineStage& stage) const {
    std::vector<int> after;
    for (const PlanTask& other : plan_.tasks) {
      const bool rig = ChoosesNet(stage) && other.stage.kind == StageKind::kCalibrate;
      if (other.stage.part.empty() && (rig || Reads(stage, other.stage))) after.push_back(other.id);
    }
    return after;
  }

  int Add(const PipelineStage& stage, double seconds, std::vector<int> after) {
    PlanTask task;
    task.id = static_cast<int>(plan_.tasks.size()) + 1;
    task.stage = stage, task.seconds = seconds, task.after = std::move(after);
    for (const std::string& input : stage.inputs)
      if (!MadeByAny(chosen_, input)) task.inputs.push_back(FingerprintOf(input));
    plan_.tasks.push_back(std::move(task));
    return plan_.tasks.back().id;
  }

  const std::vector<const PipelineStage*>& chosen_;
  const StageRecords& earlier_;
  const PartsByStage& parts_;
  Plan plan_;
};

TaskState StateOf(const Plan& plan, const PlanTask& task, const std::set<int>& done) {
  const std::optional<StageRecord> marker = ReadTaskRecord(MarkerPath(plan, task), task);
  if (marker && IsSettled(task.stage, *marker)) {
    const Judgement judged = JudgeStage(task.stage, marker->version, &*marker);
    const bool holds = judged.stale.empty() && IsSameOutput(judged.now.output, *marker);
    return holds ? TaskState::kDone : TaskState::kNotValid;
  }
  const std::optional<StageRecord> tried = ReadTaskRecord(TriedPath(plan, task), task);
  if (tried && tried->exit == kBegun) return TaskState::kBegun;
  if (tried && !IsSettled(task.stage, *tried)) return TaskState::kFailed;
  const bool waits = std::any_of(task.after.begin(), task.after.end(), [&](int id) { return done.count(id) == 0; });
  return waits ? TaskState::kWaiting : TaskState::kReady;
}

/// Ids of the tasks that make parts of the stage.
std::vector<int> PartsOf(const Plan& plan, const PlanTask& task) {
  std::vector<int> ids;
  for (const PlanTask& other : plan.tasks) {
    if (!other.stage.part.empty() && other.stage.kind == task.stage.kind && other.stage.take == task.stage.take)
      ids.push_back(other.id);
  }
  return ids;
}

}  // namespace

std::string_view ToString(TaskState state) { return WordOf(kTaskStateWords, state); }

Plan PlanOf(const PipelineOptions& options, std::vector<const PipelineStage*> chosen, const StageRecords& earlier,
            const PartsByStage& parts) {
  std::stable_sort(chosen.begin(), chosen.end(),
                   [](const PipelineStage* a, const PipelineStage* b) { return a->kind < b->kind; });
  Plan plan = PlanMaker(chosen, earlier, parts).Make();
  plan.session = options.session, plan.accept = options.accept;
  return plan;
}

std::string KeptFolder(const std::string& plan) { return plan + "/kept"; }

bool HasParts(const Plan& plan, const PlanTask& task) {
  return task.stage.part.empty() && std::any_of(task.after.begin(), task.after.end(), [&](int id) {
           const PipelineStage& earlier = TaskOf(plan, id).stage;
           return !earlier.part.empty() && earlier.kind == task.stage.kind && earlier.take == task.stage.take;
         });
}

std::string PlanText(const Plan& plan) {
  const auto line = [](const PlanJson& json) { return json.dump(-1, ' ', false, PlanJson::error_handler_t::replace) + "\n"; };
  std::string text = line({{"schema", kPlanSchema},
                           {"session", plan.session},
                           {"version", plan.version},
                           {"accept", plan.accept},
                           {"tasks", plan.tasks.size()}});
  for (const PlanTask& task : plan.tasks) text += line(TaskJson(task));
  return text;
}

Plan ReadPlan(const std::string& folder) {
  const std::string path = PlanPath(folder);
  if (!fs::exists(path)) throw UsageError(folder + " holds no plan.jsonl; `mvstudio plan` writes it");
  Plan plan;
  plan.folder = fs::canonical(folder).string();
  std::istringstream lines(ReadFile(path));
  std::string line;
  int number = 0;
  size_t expected = 0;
  try {
    while (std::getline(lines, line)) {
      const PlanJson json = PlanJson::parse(line);
      if (++number > 1) {
        plan.tasks.push_back(TaskFrom(json, plan.session));
        if (plan.tasks.back().id != number - 1)
          throw FormatError(path, "id", "line " + std::to_string(number) + " is out of order");
        continue;
      }
      if (json.at("schema") != kPlanSchema) throw FormatError(path, "schema", std::string("must be \"") + kPlanSchema + "\"");
      plan.session = json.at("session").get<std::string>();
      plan.version = json.at("version").get<std::string>();
      plan.accept = json.at("accept").get<std::vector<std::string>>();
      expected = json.at("tasks").get<size_t>();
    }
  } catch (const PlanJson::exception& e) {
    throw FormatError(path, "line " + std::to_string(std::max(1, number)), std::string("is no task of a plan: ") + e.what());
  }
  if (number == 0 || plan.tasks.size() != expected)
    throw FormatError(path, "",
                      "is cut off: " + std::to_string(plan.tasks.size()) + " of " + std::to_string(expected) + " tasks");
  return plan;
}

const PlanTask& TaskOf(const Plan& plan, int id) {
  if (id < 1 || id > static_cast<int>(plan.tasks.size())) {
    const std::string has = plan.tasks.empty() ? "no task" : "tasks 1 to " + std::to_string(plan.tasks.size());
    throw UsageError("task " + std::to_string(id) + ": the plan has " + has);
  }
  return plan.tasks[static_cast<size_t>(id - 1)];
}

std::string MarkerPath(const Plan& plan, const PlanTask& task) {
  return plan.folder + "/done/" + std::to_string(task.id) + ".json";
}

std::string TriedPath(const Plan& plan, const PlanTask& task) {
  return plan.folder + "/tried/" + std::to_string(task.id) + ".json";
}

std::optional<StageRecord> ReadTaskRecord(const std::string& path, const PlanTask& task) {
  try {
    const StageRecords records = ReadStageRecords(path);
    const auto found = records.find(task.stage.name());
    if (found != records.end()) return found->second;
  } catch (const Error&) {  // a marker that cannot be read says nothing, and the task is done again
  }
  return std::nullopt;
}

std::vector<TaskState> StatesOf(const Plan& plan) {
  std::vector<TaskState> states;
  std::set<int> done;
  for (const PlanTask& task : plan.tasks) {
    states.push_back(StateOf(plan, task, done));
    if (states.back() == TaskState::kDone) done.insert(task.id);
    if (states.back() != TaskState::kDone || !HasParts(plan, task)) continue;
    for (const int id : PartsOf(plan, task)) states[static_cast<size_t>(id - 1)] = TaskState::kDone;  // they did their work
  }
  return states;
}

std::vector<int> RemainingTasks(const Plan& plan, const std::vector<TaskState>& states) {
  std::vector<int> ids;
  for (size_t i = 0; i < plan.tasks.size(); ++i) {
    const std::vector<int>& after = plan.tasks[i].after;
    const bool waits =
        std::any_of(after.begin(), after.end(), [&](int id) { return std::binary_search(ids.begin(), ids.end(), id); });
    if (waits || states[i] != TaskState::kDone) ids.push_back(plan.tasks[i].id);
  }
  return ids;
}

}  // namespace mvstudio::stages
