#include "stages/report/run.h"

#include <chrono>
#include <ctime>

#include "core/check.h"
#include "core/disk/output.h"
#include "core/disk/paths.h"
#include "report/compare/comparison.h"

namespace mvstudio::stages {
namespace {

std::string UtcMinute() {
  const std::time_t now = std::chrono::system_clock::to_time_t(std::chrono::system_clock::now());
  char text[40];
  std::strftime(text, sizeof text, "%Y-%m-%d %H:%M UTC", std::gmtime(&now));
  return text;
}

}  // namespace

PageReport RunPage(const PageOptions& options, const PageChange& change) {
  MVS_CHECK(!options.runs.empty(), "a page is of one run or more");
  // Before the place of the page is made: it may lie in a folder that was mistyped.
  for (const std::string& run : options.runs) RequireFolder(run, "; give the option 'out' folder of an earlier command");
  const bool alone = options.runs.size() == 1;
  PageReport result;
  result.options = options;
  if (result.options.page.generated_at.empty()) result.options.page.generated_at = UtcMinute();
  result.html_path = options.out.empty() ? options.runs.back() + (alone ? "/report.html" : "/comparison.html") : options.out;
  const OutputFiles place({result.html_path, report::NumbersPath(result.html_path)}, {});
  result.page = alone ? report::BuildReport(options.runs.front(), result.options.page)
                      : report::BuildComparison(options.runs, result.options.page);
  if (change) change(&result.page);
  result.json_path = report::WriteReport(result.page, result.html_path);
  return result;
}

}  // namespace mvstudio::stages
