#include "calib/calibrate.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <set>

#include "calib/board/sides.h"
#include "cli/program/commands.h"
#include "cli/program/flag_text.h"
#include "cli/program/input_flags.h"
#include "cli/program/options.h"
#include "cli/program/output_guard.h"
#include "core/error.h"
#include "core/format.h"
#include "stages/input/corner_input.h"
#include "stages/study/tradeoff.h"

namespace mvstudio::cli {
namespace {

using nlohmann::ordered_json;

struct Arguments {
  stages::CornerArguments corners;
  std::vector<std::string> detectors{"fast", "exact"}, models{"auto", "brown1", "brown2", "brown4", "rational8"},
      engines{"mvstudio"};
  std::vector<int> views{0, 12, 6};
  std::string out;
};

/// One way to calibrate, and what came of it.
struct Trial {
  std::string detector, model, engine, status, chosen;
  int views = 0;
  double seconds = 0, holdout_px = 0, edge_mm = 0;
  bool on_front = false;

  std::string Name() const {
    return detector + ", " + (views ? std::to_string(views) + " boards" : std::string("all boards")) + ", " + model +
           (engine == "mvstudio" ? "" : ", " + engine);
  }
};

double Now() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

/// Instants that are judged and never used: every 4th. The others, thinned evenly to `views`.
calib::CalibrateInput Thin(const calib::CalibrateInput& input, int views) {
  std::set<int64_t> all;
  for (const calib::Detection& d : input.detections) all.insert(d.frame_idx);
  std::vector<int64_t> train;
  std::set<int64_t> keep;
  int index = 0;
  for (int64_t frame : all) {
    if (index++ % 4 == 3) {
      keep.insert(frame);
    } else {
      train.push_back(frame);
    }
  }
  const size_t count = views > 0 ? std::min<size_t>(views, train.size()) : train.size();
  for (size_t i = 0; i < count; ++i) keep.insert(train[i * train.size() / count]);
  calib::CalibrateInput thin = input;
  thin.detections.clear();
  for (const calib::Detection& d : input.detections) {
    if (keep.count(d.frame_idx)) thin.detections.push_back(d);
  }
  thin.held_out_frames.clear();
  index = 0;
  for (int64_t frame : all) {
    if (index++ % 4 == 3) thin.held_out_frames.push_back(frame);
  }
  return thin;
}

Trial Run(const calib::CalibrateInput& input, Trial trial, double detect_s, const RunContext& run) {
  calib::CalibrateOptions options;
  const double start = Now();
  try {
    FromString(trial.model, "model", &options.model);
    FromString(trial.engine, &options.engine);
    const calib::CalibrateReport report = Calibrate(Thin(input, trial.views), options, run);
    trial.status = std::string(ToString(report.status));
    if (!report.cameras.empty()) trial.chosen = std::string(geometry::ToString(report.cameras[0].model));
    const bool solved = report.status == Status::kOk;
    trial.holdout_px = solved ? report.rig_holdout_rms_px : std::nan("");
    trial.edge_mm = solved ? report.board_metrics.edge_rms_mm : std::nan("");
  } catch (const UsageError& error) {
    trial.status = WithFlags(error.what());
    trial.holdout_px = trial.edge_mm = std::nan("");
  }
  trial.seconds = detect_s + Now() - start;
  return trial;
}

/// Corners by every detector, with the seconds it took.
struct Source {
  std::string detector;
  calib::CalibrateInput input;
  double seconds = 0;
};

std::vector<Source> Sources(const Arguments& arguments, CommandContext& context, CommandResult* result) {
  std::vector<Source> sources;
  const bool file = !arguments.corners.corners.empty();
  for (const std::string& detector : file ? std::vector<std::string>{"file"} : arguments.detectors) {
    stages::CornerArguments corners = arguments.corners;
    corners.footage.cache.kind = calib::CachePlace::Kind::kOff;
    if (!file) FromString(detector, &corners.footage.detect.detector);
    const double start = Now();
    stages::CornerInput found = stages::ReadCornerInput(corners, context.run, result);
    result->text += RemarksOn(found);
    calib::PartSides(&found.input);
    sources.push_back({detector, std::move(found.input), file ? 0 : Now() - start});
  }
  return sources;
}

ordered_json ToJson(const std::vector<Trial>& trials) {
  ordered_json table = ordered_json::array();
  for (const Trial& t : trials) {
    table.push_back({{"detector", t.detector},
                     {"views", t.views},
                     {"model", t.model},
                     {"chosen", t.chosen},
                     {"engine", t.engine},
                     {"status", t.status},
                     {"seconds", FiniteOrNull(t.seconds)},
                     {"holdout_px", FiniteOrNull(t.holdout_px)},
                     {"edge_mm", FiniteOrNull(t.edge_mm)},
                     {"on_front", t.on_front}});
  }
  return table;
}

std::string ToText(const std::vector<Trial>& trials) {
  std::string text = "detector  boards  model       chosen       engine     seconds  held-out px  edge mm\n";
  for (const Trial& t : trials) {
    text += Format("%-8s  %6s  %-10s  %-11s  %-8s  %8s  %11s  %7s %s\n", t.detector.c_str(),
                   t.views ? std::to_string(t.views).c_str() : "all", t.model.c_str(), t.chosen.c_str(), t.engine.c_str(),
                   stages::Shown(t.seconds, 2).c_str(), stages::Shown(t.holdout_px, 4).c_str(),
                   stages::Shown(t.edge_mm, 4).c_str(), t.on_front ? "*" : "");
  }
  return text + "*: no other way is both faster and better\n";
}

CommandResult RunTradeoff(const Arguments& arguments, CommandContext& context) {
  for (const int views : arguments.views) {
    if (views < 0) throw UsageError("--views " + std::to_string(views) + ": a number of time steps, or 0 for all");
  }
  CommandResult result;
  std::vector<Trial> trials;
  const std::unique_ptr<OutputFolder> place =
      stages::TradeoffPlace(arguments.out, "calibrate", stages::CornerPaths(arguments.corners));
  const std::vector<Source> sources = Sources(arguments, context, &result);
  ProgressStage stage(
      context.run, "tradeoff",
      static_cast<int64_t>(sources.size() * arguments.views.size() * arguments.models.size() * arguments.engines.size()));
  for (const Source& source : sources) {
    for (int views : arguments.views) {
      for (const std::string& model : arguments.models) {
        for (const std::string& engine : arguments.engines) {
          Trial trial;
          trial.detector = source.detector, trial.views = views, trial.model = model, trial.engine = engine;
          trials.push_back(Run(source.input, trial, source.seconds, context.run));
          stage.Advance(1, trial.Name());
        }
      }
    }
  }
  std::vector<stages::TradeoffPoint> points;
  for (const Trial& t : trials) points.push_back({t.Name(), t.seconds, t.holdout_px});
  const std::vector<bool> on_front = stages::ParetoFront(points);
  for (size_t i = 0; i < trials.size(); ++i) trials[i].on_front = on_front[i];
  result.metrics["trials"] = ToJson(trials);
  result.text = ToText(trials);
  if (std::none_of(trials.begin(), trials.end(), [](const Trial& t) { return std::isfinite(t.holdout_px); })) {
    result.exit = kExitIllPosed;
    result.errors.push_back({"CAL-UNSOLVED",
                             "no way to calibrate gave a result; the first, " + trials[0].Name() + ": " + trials[0].status,
                             "`mvstudio calibrate` on the same input says what is missing"});
  }
  if (arguments.out.empty()) return result;
  stages::WriteTradeoffPage({"calibrate", "Calibration: speed against accuracy",
                             "Ways to calibrate: time against error on time steps that took no part",
                             "detection and solution (s)", "held-out 2-D RMS (px)"},
                            points, arguments.out, &result);
  return result;
}

}  // namespace

void RegisterTradeoffCalibrate(CLI::App& tradeoff, Registry& registry) {
  const auto arguments = std::make_shared<Arguments>();
  CLI::App* sub = tradeoff.add_subcommand(
      "calibrate", "Detector x number of boards x lens model x engine: seconds, held-out px, mm, and the Pareto front");
  AddOptions(sub, arguments->corners);
  AddOption(sub, "--detectors", arguments->detectors, "to compare")->delimiter(',')->capture_default_str();
  AddOption(sub, "--views", arguments->views, "time steps used; 0: all")->delimiter(',')->capture_default_str();
  AddOption(sub, "--models", arguments->models, "lens models, or auto")->delimiter(',')->capture_default_str();
  AddOption(sub, "--engines", arguments->engines, "mvstudio, mrcal")->delimiter(',')->capture_default_str();
  AddOutput(sub, "--out", arguments->out, OutputKind::kFolder, "folder for the table and the figure");
  registry.Add(sub, "tradeoff calibrate", [arguments](CommandContext& context) { return RunTradeoff(*arguments, context); });
}

}  // namespace mvstudio::cli
