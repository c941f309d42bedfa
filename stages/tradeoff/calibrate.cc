#include "calib/calibrate.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <set>

#include "calib/board/sides.h"
#include "core/error.h"
#include "stages/study/tradeoff.h"
#include "stages/tradeoff/run.h"

namespace mvstudio::stages {
namespace {

/// Time steps that are judged and never used: every 4th. The others, thinned evenly to `views`.
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

CalibrateTrial TimeCalibration(const calib::CalibrateInput& input, CalibrateTrial trial, double detect_s,
                               const RunContext& run) {
  calib::CalibrateOptions options;
  const double start = NowSeconds();
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
    trial.status = error.what();
    trial.holdout_px = trial.edge_mm = std::nan("");
  }
  trial.seconds = detect_s + NowSeconds() - start;
  return trial;
}

/// Corners by every detector, with the seconds it took.
struct CornerSource {
  std::string detector;
  calib::CalibrateInput input;
  double seconds = 0;
};

std::vector<CornerSource> CornerSources(const CalibrateTradeoffOptions& options, const RunContext& run, InputNotes* notes) {
  std::vector<CornerSource> sources;
  const bool file = !options.corners.corners.empty();
  for (const std::string& detector : file ? std::vector<std::string>{"file"} : options.detectors) {
    CornerArguments corners = options.corners;
    corners.footage.cache.kind = CachePlace::Kind::kOff;
    if (!file) FromString(detector, &corners.footage.detect.detector);
    const double start = NowSeconds();
    CornerInput found = ReadCornerInput(corners, run, notes);
    calib::PartSides(&found.input);
    sources.push_back({detector, std::move(found.input), file ? 0 : NowSeconds() - start});
  }
  return sources;
}

}  // namespace

CalibrateTradeoffReport RunCalibrateTradeoff(const CalibrateTradeoffOptions& options, const RunContext& run) {
  for (const int views : options.views) {
    if (views < 0) throw UsageError("option 'views' " + std::to_string(views) + ": a number of time steps, or 0 for all");
  }
  CalibrateTradeoffReport report;
  report.options = options;
  std::vector<CalibrateTrial>& trials = report.trials;
  const std::unique_ptr<OutputFolder> place = TradeoffPlace(options.out, "calibrate", CornerPaths(options.corners));
  const std::vector<CornerSource> sources = CornerSources(options, run, &report.notes);
  ProgressStage stage(
      run, "tradeoff",
      static_cast<int64_t>(sources.size() * options.views.size() * options.models.size() * options.engines.size()));
  for (const CornerSource& source : sources) {
    for (int views : options.views) {
      for (const std::string& model : options.models) {
        for (const std::string& engine : options.engines) {
          CalibrateTrial trial;
          trial.detector = source.detector, trial.views = views, trial.model = model, trial.engine = engine;
          trials.push_back(TimeCalibration(source.input, trial, source.seconds, run));
          stage.Advance(1, trial.Name());
        }
      }
    }
  }
  std::vector<TradeoffPoint> points;
  for (const CalibrateTrial& t : trials) points.push_back({t.Name(), t.seconds, t.holdout_px});
  const std::vector<bool> on_front = ParetoFront(points);
  for (size_t i = 0; i < trials.size(); ++i) trials[i].on_front = on_front[i];
  if (options.out.empty()) return report;
  report.page = WriteTradeoffPage({"calibrate", "Calibration: speed against accuracy",
                                   "Ways to calibrate: time against error on time steps that took no part",
                                   "detection and solution (s)", "held-out 2-D RMS (px)"},
                                  points, options.out);
  return report;
}

}  // namespace mvstudio::stages
