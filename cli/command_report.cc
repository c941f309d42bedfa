#include <chrono>
#include <ctime>
#include <filesystem>

#include "cli/commands.h"
#include "report/report.h"

namespace mvstudio::cli {
namespace {

std::string UtcNow() {
  const std::time_t now = std::chrono::system_clock::to_time_t(std::chrono::system_clock::now());
  char text[40];
  std::strftime(text, sizeof text, "%Y-%m-%d %H:%M UTC", std::gmtime(&now));
  return text;
}

CommandResult RunReport(report::ReportOptions options, const std::string& run, const std::string& out) {
  options.generated_at = UtcNow();
  options.version = MVSTUDIO_VERSION;
  const std::string html_path = out.empty() ? run + "/report.html" : out;
  const report::Report page = report::BuildReport(run, options);
  const std::string json_path = report::WriteReport(page, html_path);
  CommandResult result;
  result.metrics["verdict"] = std::string(report::ToString(page.verdict));
  result.metrics["num_results"] = page.num_stages;
  result.metrics["num_warnings"] = page.warnings.size();
  result.metrics["html_bytes"] = page.html.size();
  result.outputs = {{html_path, "report"}, {json_path, "report"}};
  for (const report::ReportNotice& notice : page.warnings) result.warnings.push_back({notice.code, notice.text, notice.hint});
  result.inputs = {run};
  result.text = "Report: " + std::filesystem::absolute(html_path).lexically_normal().string();
  return result;
}

}  // namespace

void RegisterReport(CLI::App& app, Registry& registry) {
  auto options = std::make_shared<report::ReportOptions>();
  auto run = std::make_shared<std::string>();
  auto out = std::make_shared<std::string>();
  CLI::App* sub =
      app.add_subcommand("report", "One offline HTML page, and the same numbers as JSON, from the saved results of a run");
  sub->add_option("RUN", *run, "folder with the results of other commands, searched four levels deep")->required();
  sub->add_option("--out", *out, "the page; the numbers go beside it with the extension .json (default: RUN/report.html)");
  AddOptions(sub, *options);
  registry.Add(sub, "report", [=](CommandContext&) { return RunReport(*options, *run, *out); });
}

}  // namespace mvstudio::cli
