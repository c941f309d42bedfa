#include "stages/report/describe.h"

#include "core/disk/place.h"

namespace mvstudio::stages {

CommandResult Describe(const PageReport& report) {
  const PageOptions& options = report.options;
  CommandResult result;
  result.metrics["verdict"] = std::string(report::ToString(report.page.verdict));
  result.metrics["sentence"] = report.page.sentence;
  result.metrics["num_results"] = report.page.num_stages;
  result.metrics["num_warnings"] = report.page.warnings.size();
  result.metrics["html_bytes"] = report.page.html.size();
  result.outputs = {{report.html_path, "report"}, {report.json_path, "report"}};
  result.warnings = report.page.warnings;
  result.inputs = options.runs;
  result.inputs.insert(result.inputs.end(), options.page.with.begin(), options.page.with.end());
  if (options.runs.size() > 1) result.text = report.page.sentence + "\n";
  result.text += "Report: " + PathOnDisk(report.html_path);
  return result;
}

}  // namespace mvstudio::stages
