#pragma once

#include <cmath>
#include <string>
#include <vector>

#include "core/progress.h"
#include "stages/input_notes.h"
#include "stages/tradeoff/options.h"
#include "triangulate/point/holdout.h"

namespace mvstudio::stages {

/// One way to calibrate, and what came of it. NaN: it gave no result.
struct CalibrateTrial {
  std::string detector, model, engine, status, chosen;
  int views = 0;
  double seconds = 0, holdout_px = 0, edge_mm = 0;
  bool on_front = false;  ///< no other way is both faster and better

  std::string Name() const {
    return detector + ", " + (views ? std::to_string(views) + " boards" : std::string("all boards")) + ", " + model +
           (engine == "mvstudio" ? "" : ", " + engine);
  }
};

template <class Visitor>
void VisitFields(Visitor&& visit, const CalibrateTrial& t) {
  visit("detector", t.detector);
  visit("views", t.views);
  visit("model", t.model);
  visit("chosen", t.chosen);
  visit("engine", t.engine);
  visit("status", t.status);
  visit("seconds", t.seconds);
  visit("holdout_px", t.holdout_px);
  visit("edge_mm", t.edge_mm);
  visit("on_front", t.on_front);
}

struct CalibrateTradeoffReport {
  CalibrateTradeoffOptions options;
  InputNotes notes;
  std::vector<CalibrateTrial> trials;
  std::string page;  ///< that was written; empty: none
};

/// Calibrates in every way that the options span and judges by every fourth time step. Throws UsageError, IoError and
/// FormatError; ways that give no result are in the report.
CalibrateTradeoffReport RunCalibrateTradeoff(const CalibrateTradeoffOptions& options, const RunContext& run = {});

/// One way to triangulate, and what came of it.
struct TriangulateTrial {
  triangulate::TakeMethod method;
  std::string precision = "double";
  int views = 0, threads = 1;
  double points_per_s = 0, coverage = 0, truth_mm = std::nan("");
  double limb_std_mm = 0;
  triangulate::LeftOutFigures holdout;
  std::string why_no_truth;  ///< where nothing could be compared
  bool on_front = false;     ///< no other way is both faster and better

  std::string Name() const {
    return std::string(ToString(method)) + (precision == "float" ? " in float, " : ", ") +
           (views ? std::to_string(views) + " views" : std::string("all views")) + ", " + std::to_string(threads) +
           (threads == 1 ? " thread" : " threads");
  }
};

template <class Visitor>
void VisitFields(Visitor&& visit, const TriangulateTrial& t) {
  visit("method", std::string(ToString(t.method)));
  visit("precision", t.precision);
  visit("views", t.views);
  visit("threads", t.threads);
  visit("points_per_s", t.points_per_s);
  visit("coverage", t.coverage);
  visit("holdout_median_px", t.holdout.median_px);
  visit("holdout_p90_px", t.holdout.p90_px);
  visit("holdout_coverage", t.holdout.coverage);
  visit("limb_std_mm", t.limb_std_mm);
  visit("truth_median_mm", t.truth_mm);
  visit("on_front", t.on_front);
}

struct TriangulateTradeoffReport {
  TriangulateTradeoffOptions options;
  InputNotes notes;
  double sigma_px = 0;
  std::vector<TriangulateTrial> trials;  ///< none: no joint is seen by two cameras
  std::string page;                      ///< that was written; empty: none
};

/// Triangulates in every way that the options span. Throws UsageError, IoError and FormatError.
TriangulateTradeoffReport RunTriangulateTradeoff(const TriangulateTradeoffOptions& options, const RunContext& run = {});

}  // namespace mvstudio::stages
