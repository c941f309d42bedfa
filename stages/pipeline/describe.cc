#include "stages/pipeline/describe.h"

#include <filesystem>

#include "core/format.h"
#include "stages/report_fields.h"

namespace mvstudio::stages {
namespace {

std::string TableOf(const PipelineReport& report) {
  std::string text;
  double seconds = 0;
  bool foretold = false;
  for (const StageRow& row : report.rows) {
    if (row.state == RowState::kNotAsked) continue;
    const bool guess = report.dry_run && row.state == RowState::kToDo && !std::isfinite(row.seconds);
    const double took = guess ? row.need.seconds : row.seconds;
    const std::string time = std::isfinite(took) ? Format(guess ? "~%.0f s" : "%.1f s", took) : "";
    text += Format("%-24s %-16s %10s %s %s\n", row.stage.c_str(), std::string(ToString(row.state)).c_str(), time.c_str(),
                   report.dry_run ? NeedText(row.need).c_str() : "", row.reason.c_str());
    if (row.state == RowState::kToDo && std::isfinite(took)) seconds += took, foretold = foretold || guess;
  }
  if (report.dry_run && seconds > 0)
    text += Format("about %.0f s, as long as it took last time%s\n", seconds, foretold ? "; ~: foretold for one thread" : "");
  return text;
}

}  // namespace

std::string NeedText(const StageNeed& need) {
  const auto cell = [](double value, const std::string& unit) {
    return std::isfinite(value) ? Format("%7.0f", value) + unit : std::string(7 + unit.size(), ' ');
  };
  return cell(need.memory_mb, " MB") + cell(need.disk_mb, " MB on disk");
}

CommandResult Describe(const PipelineReport& report) {
  CommandResult result;
  result.exit = report.exit, result.partial = report.partial;
  result.warnings = report.warnings, result.errors = report.errors;
  result.text = TableOf(report);
  result.metrics["stages"] = RowsJson(report.rows);
  for (size_t i = 0; i < report.rows.size(); ++i) {
    const RowState state = report.rows[i].state;
    const bool made = state == RowState::kDone || state == RowState::kPartial;
    if (made && std::filesystem::exists(report.stages[i].output)) result.outputs.push_back({report.stages[i].output, ""});
  }
  return result;
}

}  // namespace mvstudio::stages
