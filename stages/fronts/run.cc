#include "stages/fronts/run.h"

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <thread>

#include "core/disk/files.h"
#include "core/disk/manifest.h"
#include "core/disk/output.h"
#include "core/error.h"
#include "core/format.h"
#include "core/log.h"
#include "dataset/session/session.h"
#include "stages/budget/report.h"
#include "stages/dataset/studio_names.h"
#include "stages/fronts/plan.h"

namespace mvstudio::stages {
namespace {

namespace fs = std::filesystem;

constexpr const char* kFrontStages[] = {"calibrate", "pose2d", "mask", "triangulate", "pack", "avatar"};

void RequireStages(const std::vector<std::string>& only) {
  for (const std::string& stage : only) {
    if (std::find(std::begin(kFrontStages), std::end(kFrontStages), stage) == std::end(kFrontStages))
      throw UsageError("option 'only': '" + stage + "' is none of calibrate, pose2d, mask, triangulate, pack, avatar");
  }
}

std::string WithExtension(const std::string& page, const std::string& end) {
  return fs::path(page).replace_extension().string() + end;
}

/// One line, however long the reason.
std::string WhyItFailed(const CallOutcome& outcome) {
  if (outcome.result.errors.empty()) return "the command ended with " + std::to_string(outcome.result.exit);
  const Notice& error = outcome.result.errors.front();
  const std::string text = error.text + (error.hint.empty() ? "" : " (" + error.hint + ")");
  return text.substr(0, text.find('\n'));
}

/// Gates that fail leave figures.
bool HasFigures(const CallOutcome& outcome) {
  const int exit = outcome.result.exit;
  return exit == kExitOk || exit == kExitPartial || exit == kExitQualityGate;
}

/// Made here, and removed with what the commands wrote, whatever happens.
class RunsFolder {
 public:
  explicit RunsFolder(const std::string& path) : path_(path) { MakeFolder(path); }
  ~RunsFolder() {
    try {
      RemoveOurs({path_});
    } catch (const std::exception& error) {
      Log(LogLevel::kWarning, error.what());
    }
  }
  RunsFolder(const RunsFolder&) = delete;
  RunsFolder& operator=(const RunsFolder&) = delete;

 private:
  const std::string path_;
};

class FrontsRun {
 public:
  FrontsRun(const FrontsOptions& options, const ChildCall& call, const RunContext& run)
      : options_(options), call_(call), run_(run), runs_(WithExtension(options.out, ".runs")) {
    material_.runs = runs_, material_.quick = options.quick;
    material_.threads = run.num_threads, material_.seed = run.seed;
  }

  Fronts Measure() {
    DescribeMachine();
    if (!options_.session.empty()) FindMaterial(options_.session);
    if (fs::exists(runs_)) RemoveOurs({runs_});  // of a run that was killed
    const RunsFolder place(runs_);
    if (options_.session.empty()) {
      MakeStudio();
      FindMaterial(runs_ + "/session");
    }
    std::vector<PlannedFront> planned = PlanFronts(material_, options_.only);
    int64_t ways = 0;
    for (const PlannedFront& front : planned) ways += static_cast<int64_t>(front.ways.size());
    ProgressStage stage(run_, "tradeoff", ways);
    for (PlannedFront& front : planned) fronts_.stages.push_back(MeasureStage(front, &stage));
    return std::move(fronts_);
  }

 private:
  void DescribeMachine() {
    fronts_.threads = run_.num_threads, fronts_.seed = run_.seed;
    fronts_.processor = ProcessorName(), fronts_.cores = static_cast<int>(std::thread::hardware_concurrency());
    double load = 0;
    if (getloadavg(&load, 1) == 1) fronts_.load = load;
  }

  /// What the other stages need of it, too. Throws IoError.
  void MakeStudio() {
    const bool quick = options_.quick;
    const std::string session = runs_ + "/session", size = quick ? "320x240" : "480x360";
    const std::string cameras = quick ? "5" : "6", boards = quick ? "80" : "120", frames = quick ? "24" : "60";
    const LineOption seed{"seed", {std::to_string(run_.seed)}}, threads{"threads", {std::to_string(run_.num_threads)}};
    const CommandLine synth = {{"synth"},
                               {{"out", {session}},
                                {"cameras", {cameras}},
                                {"size", {size}},
                                {"noise-px", {"1"}},
                                {"board-frames", {boards}},
                                {"take-frames", {frames}},
                                seed,
                                threads}};
    const CommandLine stages = {{"run", session}, {{"to", {"dataset"}}, seed, threads}};
    fronts_.footage = "Synthetic studio: " + cameras + " cameras of " + size + " px, " + boards + " frames of a board, " +
                      frames + " of a person, 1 px of noise on the 2D joints that triangulate takes.";
    for (const CommandLine& line : {synth, stages}) {
      const CallOutcome outcome = Call(line);
      if (!HasFigures(outcome)) throw IoError(session, "`" + line.Text() + "`: " + WhyItFailed(outcome));
    }
  }

  void FindMaterial(const std::string& folder) {
    const dataset::Session session = dataset::ReadSession(folder);
    const dataset::SessionTake& take = TakeOf(session, options_.take);
    const auto there = [](const std::string& path, const std::string& file) {
      return fs::exists(path + file) ? path : std::string();
    };
    material_.session = folder, material_.take = take.name;
    material_.calibration = CalibrationOf(session);
    material_.pose3d = there(TakeFolder(session, "pose3d", take.name), "/points.csv");
    material_.dataset = there(TakeFolder(session, "dataset", take.name), "/dataset.json");
    material_.truth_masks = there(folder + "/truth/masks/" + take.name, "");
    for (const dataset::SessionFootage& footage : take.footage) material_.cameras.push_back(footage.camera);
    for (const auto& [panoptic, name] : StudioNames(material_.dataset)) {
      material_.held_out = name;
      if (name != material_.cameras.front()) break;  // the first often fixes the world
    }
    if (material_.held_out.empty()) material_.held_out = material_.cameras.back();
    if (fronts_.footage.empty()) fronts_.footage = "Session " + folder + ", take " + take.name + ".";
  }

  StageFront MeasureStage(PlannedFront& planned, ProgressStage* stage) {
    StageFront front = planned.front;
    for (const PlannedWay& way : planned.ways) {
      if (front.why_not.empty()) front.ways.push_back(MeasureWay(way, stage, front.stage + ", " + way.name));
      stage->Advance(1);
    }
    MarkFronts(&front);
    return front;
  }

  FrontWay MeasureWay(const PlannedWay& planned, ProgressStage* stage, const std::string& name) {
    FrontWay way;
    way.name = planned.name, way.mark = planned.mark, way.command = planned.work.Text();
    stage->Advance(0, name);
    const CallOutcome work = Call(planned.work);
    CallOutcome judge;
    const bool judged = HasFigures(work) && !planned.judge.command.empty();
    if (judged) judge = Call(planned.judge);
    if (!HasFigures(work) || (judged && !HasFigures(judge))) {
      way.why_not = WhyItFailed(HasFigures(work) ? judge : work);
      return way;
    }
    way.seconds = work.seconds, way.cpu_s = work.cpu_s, way.peak_rss_mb = work.peak_rss_mb;
    planned.read(work.result, judge.result, &way);
    if (!std::isfinite(way.error)) way.why_not = "nothing was held out of it";
    return way;
  }

  CallOutcome Call(const CommandLine& line) const {
    return call_(line, runs_, [] {});
  }

  const FrontsOptions& options_;
  const ChildCall& call_;
  const RunContext& run_;
  const std::string runs_;
  FrontsMaterial material_;
  Fronts fronts_;
};

std::string WayLine(const FrontWay& way) {
  if (!way.why_not.empty()) return Format("  %-30s %s\n", way.name.c_str(), way.why_not.c_str());
  return Format("  %-30s %-8s %9.3g %9.3g %9.4g %10.4g %s\n", way.name.c_str(), std::string(ToString(way.mark)).c_str(),
                way.time(), way.seconds, way.peak_rss_mb, way.error, way.time_front ? "*" : "");
}

std::string FrontText(const StageFront& front) {
  if (!front.why_not.empty()) return front.stage + ": not measured, " + front.why_not + "\n";
  std::string text = front.stage + ": " + front.error + "\n" +
                     Format("  %-30s %-8s %9s %9s %9s %10s\n", "way", "", "s", "s, clock", "MiB", "error");
  for (const FrontWay& way : front.ways) text += WayLine(way);
  return text;
}

}  // namespace

FrontsReport RunFronts(const FrontsOptions& options, const ChildCall& call, const RunContext& run) {
  RequireStages(options.only);
  if (!options.from.empty() && (!options.session.empty() || !options.only.empty() || options.quick))
    throw UsageError("option 'from' measures nothing: leave out option 'session', option 'only' and option 'quick'");
  FrontsReport report;
  report.page = options.out, report.results = WithExtension(options.out, ".json");
  const bool again = !options.from.empty() && fs::exists(report.results) && fs::equivalent(options.from, report.results);
  std::vector<std::string> outputs = {report.page};
  if (!again) outputs.push_back(report.results);
  const OutputFiles place(outputs, {options.from, options.session});
  if (options.from.empty()) {
    report.fronts = FrontsRun(options, call, run).Measure();
  } else {
    report.notes.inputs.push_back(options.from);
    report.fronts = ReadFronts(options.from);
  }
  if (!again) WriteFileAtomic(report.results, FrontsJson(report.fronts));
  WriteFileAtomic(report.page, FrontsPage(report.fronts));
  return report;
}

CommandResult Describe(const FrontsReport& report) {
  CommandResult result;
  static_cast<InputNotes&>(result) = report.notes;
  result.metrics = nlohmann::ordered_json::parse(FrontsJson(report.fronts));
  result.outputs = {{report.page, "figure"}, {report.results, "figures"}};
  for (const StageFront& front : report.fronts.stages) result.text += FrontText(front);
  result.text += "*: no other way is both cheaper and better\n";
  const auto none = [](const StageFront& front) { return !front.why_not.empty(); };
  const std::vector<StageFront>& stages = report.fronts.stages;
  if (stages.empty() || !std::all_of(stages.begin(), stages.end(), none)) return result;
  result.exit = kExitIllPosed;
  result.errors.push_back(
      {"TRD-NOTHING", "not one stage could be measured; the first, " + stages.front().stage + ": " + stages.front().why_not,
       "`mvstudio doctor` says what the session lacks"});
  return result;
}

}  // namespace mvstudio::stages
