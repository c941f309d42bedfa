#include <malloc.h>
#include <unistd.h>

#include <algorithm>
#include <set>
#include <string_view>

#include "cli/program/companion.h"
#include "cli/program/console.h"
#include "cli/program/interrupt.h"
#include "cli/program/redact.h"
#include "cli/program/result.h"
#include "cli/program/run_line.h"
#include "core/error.h"
#include "core/stopwatch.h"
#include "core/text/one_line.h"

namespace mvstudio::cli {
namespace {

/// Every training step frees and takes the same blocks: given back to the system in between, they cost an eighth of the time.
void KeepFreedMemory() {
  mallopt(M_MMAP_THRESHOLD, 32 << 20);
  mallopt(M_TRIM_THRESHOLD, 1 << 30);
}

std::string WithHint(const Notice& notice) { return notice.text + (notice.hint.empty() ? "" : " (" + notice.hint + ")"); }

void PrintLine(std::string_view line) { (void)!write(STDERR_FILENO, line.data(), line.size()); }

/// Text of the program's own, one line, past all buffers.
void PrintNotice(const std::string& label, Colour colour, const std::string& text) {
  PrintLine(Painted(label, colour, STDERR_FILENO) + OneLine(text) + "\n");
}

void PrintErrors(const CommandResult& result) {
  for (const Notice& notice : result.errors) PrintNotice("error: ", Colour::kRed, WithHint(notice));
}

/// What made a gate fail first; what is to be done about several of them once.
void PrintWarnings(std::vector<Notice> warnings) {
  std::stable_partition(warnings.begin(), warnings.end(), [](const Notice& notice) { return notice.fails; });
  std::set<std::string> told;
  for (Notice& notice : warnings) {
    if (!told.insert(notice.hint).second) notice.hint.clear();
    const std::string label = (notice.fails ? "failed " : "warning ") + notice.code + ": ";
    PrintNotice(label, notice.fails ? Colour::kRed : Colour::kYellow, WithHint(notice));
  }
}

void PrintForPerson(const CommandResult& result) {
  if (!result.text.empty())
    PrintOut(WithPaintedVerdicts(ManyLines(result.text), STDOUT_FILENO) + (result.text.back() == '\n' ? "" : "\n"));
  PrintWarnings(result.warnings);
  std::string written;
  for (const auto& output : result.outputs) {
    const bool small = output.role == "heldout-picture" || output.role == "board-view" || output.role == "joint-view";
    if (!small) written += OneLine((result.unchanged_since.empty() ? "Wrote " : "Kept ") + output.path) + "\n";
  }
  PrintOut(written);
}

/// The exit code: that of the command, unless its outcome could not be printed.
int Print(const LineOutcome& outcome, bool json) {
  PrintErrors(outcome.result);
  try {
    if (!outcome.help.empty()) {
      PrintOut(outcome.help);
    } else if (json) {
      PrintOut(JsonText(RedactedJson(outcome.json)));
    } else {
      PrintForPerson(outcome.result);
    }
    return outcome.result.exit;
  } catch (const Error&) {
    const CommandResult failure = ResultOfCurrentException();
    PrintErrors(failure);
    return failure.exit;
  }
}

/// What a command that was ended from outside would have said itself.
LastWords LastWordsOf(const std::string& command, bool json, const std::vector<std::string>& argv) {
  const Stopwatch watch;
  return [=](const CommandResult& result) {
    LineOutcome outcome;
    outcome.command = command;
    outcome.result = result;
    const double wall_s = watch.Seconds();
    outcome.json = ResultToJson(command, outcome.result, wall_s, argv);
    Print(outcome, json);
  };
}

int Main(int argc, char** argv) {
  const std::vector<std::string> words(argv + 1, argv + argc);
  GlobalOptions global;
  const LineOutcome outcome = RunLine(words, global, [&](const Registry::Entry& entry, CommandContext& context) {
    InstallLog(global.log_level);
    InstallSignalHandlers(LastWordsOf(entry.name, global.json, {argv, argv + argc}));
    const std::unique_ptr<ProgressSink> progress = MakeProgress(global.progress);
    context.run = {progress.get(), global.threads, global.seed}, context.argv = {argv, argv + argc};
    return entry.run(context);
  });
  ClaimOutput();
  return Print(outcome, global.json);
}

/// What could not even begin, or not be printed: says why not.
int Failed(int argc, char** argv) {
  try {
    LineOutcome outcome;
    outcome.result = ResultOfCurrentException();
    outcome.json = ResultToJson("", outcome.result, 0, {argv, argv + argc});
    return Print(outcome, std::find(argv, argv + argc, std::string("--json")) != argv + argc);
  } catch (...) {
    PrintLine("error: out of memory\n");
    return kExitResources;
  }
}

}  // namespace
}  // namespace mvstudio::cli

int main(int argc, char** argv) {
  using namespace mvstudio::cli;
  try {
    LimitBlasThreads(argv);
    if (!Runs(argv)) HandOver(argv);
    PrepareProcess();
    ReserveBlasMemory(Trains(argv));
    if (Trains(argv)) KeepFreedMemory();
    return Main(argc, argv);
  } catch (...) {
    return Failed(argc, argv);
  }
}
