#include "stages/plan/describe.h"

#include <algorithm>
#include <map>

#include "core/format.h"
#include "core/join.h"
#include "stages/pipeline/describe.h"
#include "stages/report_fields.h"

namespace mvstudio::stages {
namespace {

std::string TaskTable(const Plan& plan) {
  if (plan.tasks.empty()) return "up to date: no stage has to be done\n";
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
  if (seconds > 0) text += Format("about %.0f s of work: as long as it took last time, else as foretold for one thread\n", seconds);
  return text;
}

std::string KindTable(const JobsReport& report) {
  std::map<StageKind, std::map<TaskState, int>> by_kind;
  for (size_t i = 0; i < report.rows.size(); ++i) ++by_kind[report.kinds[i]][report.rows[i].state];
  std::string text;
  for (const auto& [kind, counts] : by_kind) {
    const auto cell = [](const auto& count) { return std::to_string(count.second) + " " + std::string(ToString(count.first)); };
    text += Format("%-12s ", std::string(ToString(kind)).c_str()) + Join(counts, ", ", cell) + "\n";
  }
  return text;
}

}  // namespace

CommandResult Describe(const PlanReport& report) {
  CommandResult result;
  result.warnings = report.warnings;
  for (const std::string& path : report.outputs) result.outputs.push_back({path, "plan"});
  result.metrics["num_tasks"] = report.plan.tasks.size();
  result.inputs = {report.session_file};
  result.folder = report.folder;
  result.text = TaskTable(report.plan);
  return result;
}

CommandResult Describe(const TaskReport& report) {
  CommandResult result;
  const StageRow& row = report.row;
  const bool failed = row.state == RowState::kFailed;
  result.warnings = report.said.warnings;
  Append(report.said.errors, failed ? &result.errors : &result.warnings);
  if (failed) result.exit = report.said.exit == kExitInterrupted ? static_cast<int>(kExitTryAgain) : report.said.exit;
  result.metrics["task"] = report.task;
  result.metrics["stages"] = RowsJson(std::vector<StageRow>{row});
  result.text = row.stage + ": " + std::string(ToString(row.state)) + (row.reason.empty() ? "" : " (" + row.reason + ")");
  return result;
}

CommandResult Describe(const JobsReport& report) {
  CommandResult result;
  if (report.num_submitted > 0) {
    result.metrics["num_submitted"] = report.num_submitted;
    result.text = report.said;
    return result;
  }
  const auto num_done =
      std::count_if(report.rows.begin(), report.rows.end(), [](const TaskRow& row) { return row.state == TaskState::kDone; });
  const int num_tasks = static_cast<int>(report.rows.size());
  result.metrics["tasks"] = RowsJson(report.rows);
  result.metrics["num_done"] = num_done;
  result.errors = report.errors;
  result.exit = report.exit;
  result.partial = result.exit == kExitOk && num_done < num_tasks;
  result.text = KindTable(report) + Format("%d of %d tasks are done\n", static_cast<int>(num_done), num_tasks);
  return result;
}

}  // namespace mvstudio::stages
