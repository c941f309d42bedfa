#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "cli/program/redact.h"
#include "cli/program/result.h"
#include "core/error.h"
#include "stages/report/describe.h"
#include "stages/study/study.h"

namespace mvstudio::cli {
namespace {

/// Texts alone: what was embedded, and the page itself, stay.
void Redact(report::Report* page) {
  const auto numbers = nlohmann::ordered_json::parse(page->json);
  KnowPaths(numbers);
  page->html = report::MapTexts(page->html, Redacted);
  page->json = JsonText(RedactedJson(numbers));
}

CommandResult RunReport(stages::PageOptions options, const std::vector<std::string>& argv) {
  if (options.page.audience == "client") StartRedacting(argv);
  options.page.version = MVSTUDIO_VERSION;
  return Describe(RunPage(options, Redacting() ? Redact : stages::PageChange()));
}

}  // namespace

void RegisterReport(CLI::App& app, Registry& registry) {
  auto options = std::make_shared<stages::PageOptions>();
  auto study = std::make_shared<stages::StudyArguments>();
  auto anew = std::make_shared<bool>(true);
  CLI::App* sub = app.add_subcommand(
      "report",
      "One offline HTML page, and the same numbers as JSON, from the saved results of a run, or of several runs side by "
      "side; or a page for a user study, and the count of its answers");
  AddOption(sub, "RUN", options->runs,
            "folder with the results of other commands, searched four levels deep; of several, the earliest first, the last is "
            "compared with the first: what got better or worse, and what differs");
  AddOptions(sub, *options);
  AddOption(sub, "--study", study->sides,
            "instead of a report: a page that asks which of two images is closer to the truth; two scored runs, or two "
            "folders with the same file names, each FOLDER or NAME=FOLDER")
      ->expected(2);
  AddOption(sub, "--truth", study->truth, "study: folder of the true images; of runs, the truth that they were scored with");
  AddOption(sub, "--study-pictures", study->images, "study: questions at most, evenly over the images")->capture_default_str();
  AddFlag(sub, "--overwrite", *anew, "needs not be given: a report is always written anew");
  AddOption(sub, "--study-tally", study->tally, "instead of a report: count these files of answers");
  registry.Add(sub, "report", [=](CommandContext& context) {
    static_cast<void>(anew);  // holds the flag's value while the command line is parsed
    const int asked = static_cast<int>(!options->runs.empty()) + static_cast<int>(!study->sides.empty()) +
                      static_cast<int>(!study->tally.empty());
    if (asked != 1) throw UsageError("report needs one of RUN, --study A B and --study-tally ANSWERS");
    study->title = options->page.title;
    study->follow_links = options->page.follow_links;
    if (!study->sides.empty()) return stages::RunStudy(*study, options->out, context.run.seed);
    if (!study->tally.empty()) return stages::RunStudyTally(*study);
    return RunReport(*options, context.argv);
  });
}

}  // namespace mvstudio::cli
