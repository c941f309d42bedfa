#include "stages/tradeoff/describe.h"

#include <algorithm>
#include <cmath>

#include "core/format.h"
#include "stages/people/pose_truth.h"
#include "stages/report_fields.h"
#include "stages/study/tradeoff.h"

namespace mvstudio::stages {
namespace {

std::string CalibrateWaysText(const std::vector<CalibrateTrial>& trials) {
  std::string text = "detector  boards  model       chosen       engine     seconds  held-out px  edge mm\n";
  for (const CalibrateTrial& t : trials) {
    text +=
        Format("%-8s  %6s  %-10s  %-11s  %-8s  %8s  %11s  %7s %s\n", t.detector.c_str(),
               t.views ? std::to_string(t.views).c_str() : "all", t.model.c_str(), t.chosen.c_str(), t.engine.c_str(),
               Shown(t.seconds, 2).c_str(), Shown(t.holdout_px, 4).c_str(), Shown(t.edge_mm, 4).c_str(), t.on_front ? "*" : "");
  }
  return text + "*: no other way is both faster and better\n";
}

std::string TriangulateWaysText(const std::vector<TriangulateTrial>& trials) {
  std::string text =
      "method          precision  views  threads   points/s  coverage  left-out px  (90 %)  limbs mm  truth mm\n";
  for (const TriangulateTrial& t : trials) {
    text += Format("%-14s  %9s  %5s  %7d  %9.0f  %8s  %11s  %6s  %8s  %8s %s\n", std::string(ToString(t.method)).c_str(),
                   t.precision.c_str(), t.views ? std::to_string(t.views).c_str() : "all", t.threads, t.points_per_s,
                   Shown(t.coverage, 3).c_str(), Shown(t.holdout.median_px, 3).c_str(), Shown(t.holdout.p90_px, 2).c_str(),
                   Shown(t.limb_std_mm, 2).c_str(), Shown(t.truth_mm, 3).c_str(), t.on_front ? "*" : "");
  }
  return text + "*: no other way is both faster and better\n";
}

CommandResult DescribeWaysPage(const std::string& page, const std::string& folder) {
  CommandResult result;
  if (page.empty()) return result;
  result.outputs.push_back({page, "figure"});
  result.folder = folder;
  return result;
}

}  // namespace

CommandResult Describe(const CalibrateTradeoffReport& report) {
  const std::vector<CalibrateTrial>& trials = report.trials;
  CommandResult result = DescribeWaysPage(report.page, report.options.out);
  static_cast<InputNotes&>(result) = report.notes;
  result.metrics["trials"] = RowsJson(trials);
  result.text = CalibrateWaysText(trials);
  if (std::any_of(trials.begin(), trials.end(), [](const CalibrateTrial& t) { return std::isfinite(t.holdout_px); }))
    return result;
  result.exit = kExitIllPosed;
  result.errors.push_back({"CAL-UNSOLVED",
                           "no way to calibrate gave a result; the first, " + trials[0].Name() + ": " + trials[0].status,
                           "`mvstudio calibrate` on the same input says what is missing"});
  return result;
}

CommandResult Describe(const TriangulateTradeoffReport& report) {
  CommandResult result = DescribeWaysPage(report.page, report.options.out);
  static_cast<InputNotes&>(result) = report.notes;
  if (report.trials.empty()) {
    result.exit = kExitIllPosed;
    result.errors.push_back({"TRI-NO-POINTS", "nothing to compare: no joint is seen by 2 cameras in one frame",
                             "frame numbers of the cameras must overlap: `mvstudio sync` finds offsets"});
    return result;
  }
  result.metrics["sigma_px"] = report.sigma_px;
  result.metrics["trials"] = RowsJson(report.trials);
  result.text = TriangulateWaysText(report.trials);
  for (const TriangulateTrial& trial : report.trials) {
    if (trial.why_no_truth.empty() || !result.errors.empty()) continue;
    result.exit = kExitQualityGate;
    result.errors.push_back(NothingInCommon("truth", report.options.truth, trial.why_no_truth));
  }
  return result;
}

}  // namespace mvstudio::stages
