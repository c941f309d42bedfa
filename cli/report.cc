#include "report/report.h"

#include <algorithm>
#include <chrono>
#include <ctime>
#include <filesystem>

#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "cli/program/output_guard.h"
#include "cli/program/redact.h"
#include "cli/program/result.h"
#include "core/disk/place.h"
#include "core/error.h"
#include "report/compare/comparison.h"
#include "stages/study/study.h"

namespace mvstudio::cli {
namespace {

std::string UtcNow() {
  const std::time_t now = std::chrono::system_clock::to_time_t(std::chrono::system_clock::now());
  char text[40];
  std::strftime(text, sizeof text, "%Y-%m-%d %H:%M UTC", std::gmtime(&now));
  return text;
}

/// Texts alone: what was embedded, and the page itself, stay.
void Redact(report::Report* page) {
  const auto numbers = nlohmann::ordered_json::parse(page->json);
  KnowPaths(numbers);
  page->html = report::MapTexts(page->html, Redacted);
  page->json = JsonText(RedactedJson(numbers));
}

/// The page of one run, or of several side by side.
report::Report PageOf(const std::vector<std::string>& runs, const report::ReportOptions& options) {
  return runs.size() == 1 ? report::BuildReport(runs.front(), options) : report::BuildComparison(runs, options);
}

CommandResult RunReport(report::ReportOptions options, const std::vector<std::string>& runs, const std::string& out,
                        const std::vector<std::string>& argv) {
  if (options.audience == "client") StartRedacting(argv);
  options.generated_at = UtcNow();
  options.version = MVSTUDIO_VERSION;
  const std::string html_path = out.empty() ? runs.back() + (runs.size() == 1 ? "/report.html" : "/comparison.html") : out;
  const OutputFiles place({html_path, report::NumbersPath(html_path)}, {});
  report::Report page = PageOf(runs, options);
  if (Redacting()) Redact(&page);
  const std::string json_path = report::WriteReport(page, html_path);
  CommandResult result;
  result.metrics["verdict"] = std::string(report::ToString(page.verdict));
  result.metrics["sentence"] = page.sentence;
  result.metrics["num_results"] = page.num_stages;
  result.metrics["num_warnings"] = page.warnings.size();
  result.metrics["html_bytes"] = page.html.size();
  result.outputs = {{html_path, "report"}, {json_path, "report"}};
  Append(page.warnings, &result.warnings);
  result.inputs = Joined(runs, options.with);
  result.text = (runs.size() == 1 ? "" : page.sentence + "\n") + ("Report: " + PathOnDisk(html_path));
  return result;
}

}  // namespace

void RegisterReport(CLI::App& app, Registry& registry) {
  auto options = std::make_shared<report::ReportOptions>();
  auto study = std::make_shared<stages::StudyArguments>();
  auto runs = std::make_shared<std::vector<std::string>>();
  auto out = std::make_shared<std::string>();
  auto anew = std::make_shared<bool>(true);
  CLI::App* sub = app.add_subcommand(
      "report",
      "One offline HTML page, and the same numbers as JSON, from the saved results of a run, or of several runs side by "
      "side; or a page for a user study, and the count of its answers");
  AddOption(sub, "RUN", *runs,
            "folder with the results of other commands, searched four levels deep; of several, the earliest first, the last is "
            "compared with the first: what got better or worse, and what differs");
  AddOutput(sub, "--out", *out, OutputKind::kFile,
            "the page; the numbers go beside it with the extension .json (default: RUN/report.html, of several LAST/comparison.html)");
  AddOptions(sub, *options);
  AddOption(sub, "--study", study->sides,
            "instead of a report: a page that asks which of two images is closer to the truth; two scored runs, or two "
            "folders with the same file names, each FOLDER or NAME=FOLDER")
      ->expected(2);
  AddOption(sub, "--truth", study->truth, "study: folder of the true images; of runs, the truth that they were scored with");
  AddOption(sub, "--study-pictures", study->pictures, "study: questions at most, evenly over the images")
      ->capture_default_str();
  AddFlag(sub, "--overwrite", *anew, "needs not be given: a report is always written anew");
  AddOption(sub, "--study-tally", study->tally, "instead of a report: count these files of answers");
  registry.Add(sub, "report", [=](CommandContext& context) {
    static_cast<void>(anew);  // holds the flag's value while the command line is parsed
    const int asked =
        static_cast<int>(!runs->empty()) + static_cast<int>(!study->sides.empty()) + static_cast<int>(!study->tally.empty());
    if (asked != 1) throw UsageError("report needs one of RUN, --study A B and --study-tally ANSWERS");
    study->title = options->title;
    study->follow_links = options->follow_links;
    if (!study->sides.empty()) return stages::RunStudy(*study, *out, context.run.seed);
    if (!study->tally.empty()) return stages::RunStudyTally(*study);
    return RunReport(*options, *runs, *out, context.argv);
  });
}

}  // namespace mvstudio::cli
