#include "stages/demo/describe.h"

#include "core/disk/place.h"
#include "core/format.h"
#include "core/units.h"
#include "stages/report_fields.h"

namespace mvstudio::stages {
namespace {

using DemoJson = nlohmann::ordered_json;

DemoJson TruthJson(const StudioComparison& t) {
  return {{"rig_rotation_deg", RadToDeg(t.rig.max_rotation_rad)},
          {"rig_translation_mm", 1000 * t.rig.max_translation_m},
          {"focal_percent", 100 * t.rig.max_focal_relative},
          {"joints_median_mm", t.joints_median_mm},
          {"joints_mean_mm", t.joints_mean_mm},
          {"joints_predicted_sigma_mm", t.predicted_sigma_median_mm},
          {"joints_coverage68", t.coverage68},
          {"joints_coverage95", t.coverage95},
          {"joints", t.num_joints}};
}

/// A stage that gave no result ends the demo with its exit code and reason.
CommandResult DescribeFailure(const DemoReport& report) {
  CommandResult failed;
  failed.exit = report.exit;
  failed.errors = report.errors;
  failed.warnings = report.warnings;
  for (const StageRow& row : report.rows)
    if (row.state == RowState::kFailed)
      failed.warnings.push_back({"DEMO-STAGE", "the demo ended at: " + row.command, "run that command alone to look closer"});
  failed.metrics["stages"] = RowsJson(report.rows);
  return failed;
}

}  // namespace

CommandResult Describe(const DemoReport& report) {
  if (!report.truth) return DescribeFailure(report);
  CommandResult result;
  result.warnings = report.warnings, result.errors = report.errors;
  result.exit = report.exit;
  result.metrics["quick"] = report.options.quick;
  result.metrics["truth"] = TruthJson(*report.truth);
  result.metrics["avatar"] = {{"holdout", report.scores.value("holdout", DemoJson::object())},
                              {"baselines", report.scores.value("baselines", DemoJson::object())}};
  result.metrics["stages"] = RowsJson(report.rows);
  result.metrics["checks"] = RowsJson(report.checks);
  for (const DemoCheck& check : report.checks) {
    result.text += Format("%-6s %-55s %9.4f  %s %g %s\n", check.Pass() ? "ok" : "MISSED", check.name.c_str(), check.value,
                          check.at_least ? ">=" : "<=", check.bound, check.unit.c_str());
    if (!check.Pass() && !report.options.quick && result.exit == kExitOk) result.exit = kExitQualityGate;
  }
  const std::string page = report.options.out + "/report.html";
  result.outputs = {{page, "report"}, {report.options.out + "/report.json", "report"}};
  result.text += "Report: " + PathOnDisk(page);
  return result;
}

}  // namespace mvstudio::stages
