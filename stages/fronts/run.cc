#include "stages/fronts/run.h"

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <thread>

#include "core/disk/files.h"
#include "core/disk/manifest.h"
#include "core/disk/output.h"
#include "core/error.h"
#include "core/format.h"
#include "core/log.h"
#include "stages/budget/report.h"
#include "stages/fronts/measure_growth.h"
#include "stages/fronts/peers.h"

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
      : options_(options), run_(run), runs_(WithExtension(options.out, ".runs")), meter_(call, runs_, run) {}

  Fronts Measure() {
    DescribeMachine();
    if (!options_.session.empty()) FindMaterial(options_.session);
    if (fs::exists(runs_)) RemoveLeftovers(runs_), RemoveOurs({runs_});  // of a run that was killed
    const RunsFolder place(runs_);
    const bool synthetic = options_.session.empty();
    std::optional<LentFolder> studio;
    if (synthetic) {
      studio.emplace(runs_ + "/studio");
      MakeStudio(studio->path() + "/session");
      FindMaterial(studio->path() + "/session");
    }
    std::vector<PlannedFront> planned = PlanFronts(material_, options_.only);
    int64_t ways = synthetic ? NumGrownStudios(options_.quick) : 0;
    for (const PlannedFront& front : planned) ways += static_cast<int64_t>(front.ways.size());
    ProgressStage stage(run_, "tradeoff", ways);
    for (PlannedFront& front : planned) fronts_.stages.push_back(MeasureStage(front, &stage));
    if (synthetic)
      fronts_.grown = GrownStudio(options_.quick),
      fronts_.growth = MeasureGrowth(meter_, options_.only, options_.quick, &stage);
    return std::move(fronts_);
  }

 private:
  void DescribeMachine() {
    fronts_.threads = run_.num_threads, fronts_.seed = run_.seed;
    fronts_.processor = ProcessorName(), fronts_.cores = static_cast<int>(std::thread::hardware_concurrency());
    double load = 0;
    if (getloadavg(&load, 1) == 1) fronts_.load = load;
  }

  /// Throws IoError.
  void MakeStudio(const std::string& session) {
    const StudioSize size = options_.quick ? StudioSize{5, 320, 240, 80, 24} : StudioSize{6, 480, 360, 120, 60};
    fronts_.footage = Format(
        "Synthetic studio: %d cameras of %dx%d px, %d frames of a board, %d of a person, 1 px of noise on the 2D joints that "
        "triangulate takes.",
        size.cameras, size.width, size.height, size.board_frames, size.take_frames);
    meter_.MakeStudio(size, {}, session);
  }

  void FindMaterial(const std::string& folder) {
    material_ = meter_.MaterialOf(folder, options_.take, options_.quick);
    if (fronts_.footage.empty()) fronts_.footage = "Session " + folder + ", take " + material_.take + ".";
  }

  StageFront MeasureStage(PlannedFront& planned, ProgressStage* stage) {
    StageFront front = planned.front;
    for (const PlannedWay& way : planned.ways) {
      stage->Advance(0, front.stage + ", " + way.name);
      if (front.why_not.empty()) front.ways.push_back(meter_.MeasureWay(way));
      stage->Advance(1);
    }
    if (!options_.peers.empty() && front.why_not.empty()) {
      stage->Advance(0, front.stage + ", peers");
      for (FrontWay& way : PeerWays(options_.peers, front.stage, material_)) front.ways.push_back(std::move(way));
    }
    MarkFronts(&front);
    return front;
  }

  const FrontsOptions& options_;
  const RunContext& run_;
  const std::string runs_;
  const FrontsMeter meter_;
  FrontsMaterial material_;
  Fronts fronts_;
};

std::string GrowthText(const std::vector<GrowthRow>& rows) {
  if (rows.empty()) return "";
  std::string text = "growth: stage, what grows, exponent of the processor time\n";
  for (const GrowthRow& row : rows) {
    const std::string exponent = std::isfinite(row.exponent) ? Format("%.2f", row.exponent) : "flat";
    const std::string why = row.why_not.empty() ? row.reason : row.why_not;
    text += Format("  %-12s %-8s %6s %s\n", row.stage.c_str(), row.axis.c_str(),
                   row.factors.size() > 1 ? exponent.c_str() : "-", why.c_str());
  }
  return text;
}

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
  if (!options.from.empty() && (!options.session.empty() || !options.only.empty() || options.quick || !options.peers.empty()))
    throw UsageError(
        "option 'from' measures nothing: leave out option 'session', option 'only', option 'peers' and option 'quick'");
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
  result.text += "*: no other way is both cheaper and better\n" + GrowthText(report.fronts.growth);
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
