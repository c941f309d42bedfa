#include <malloc.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <cstring>

#include "cli/console.h"
#include "cli/interrupt.h"
#include "cli/redact.h"
#include "cli/result.h"
#include "cli/run_line.h"
#include "core/error.h"

namespace mvstudio::cli {
namespace {

bool Trains(char** argv) {
  bool trains = false;
  for (char** word = argv; *word; ++word) trains = trains || !std::strcmp(*word, "avatar") || !std::strcmp(*word, "demo");
  return trains;
}

/// Every training step frees and takes the same blocks: given back to the system in between, they cost an eighth of the time.
void KeepFreedMemory() {
  mallopt(M_MMAP_THRESHOLD, 32 << 20);
  mallopt(M_TRIM_THRESHOLD, 1 << 30);
}

/// OpenMP threads spin at every barrier before they sleep; on busy or small machines that makes training ten times slower. The
/// limit is read before main() begins, so the program starts itself once more with it. Measured: 1.7 -> 18.7 steps/s beside two
/// busy processes, and 13 -> 18 alone (2 cores). Only the commands that train do it: starting costs half a second.
void RestartWithShortSpins(char** argv) {
  if (std::getenv("GOMP_SPINCOUNT") || std::getenv("OMP_WAIT_POLICY")) return;
  setenv("GOMP_SPINCOUNT", "1000", 1);
  execv("/proc/self/exe", argv);  // comes back only when that is not possible: then it is merely slower
}

std::string WithHint(const Notice& notice) { return notice.text + (notice.hint.empty() ? "" : " (" + notice.hint + ")"); }

/// Text of the program's own, one line, past all buffers.
void PrintNotice(const std::string& text) {
  const std::string line = OneLine(text) + "\n";
  (void)!write(STDERR_FILENO, line.data(), line.size());
}

void PrintErrors(const CommandResult& result) {
  for (const Notice& notice : result.errors) PrintNotice("error: " + WithHint(notice));
}

void PrintForPerson(const CommandResult& result) {
  if (!result.text.empty()) PrintOut(ManyLines(result.text) + (result.text.back() == '\n' ? "" : "\n"));
  for (const Notice& notice : result.warnings) PrintNotice("warning " + notice.code + ": " + WithHint(notice));
  std::string written;
  for (const auto& output : result.outputs) {
    if (output.role != "heldout-picture") written += OneLine("Wrote " + output.path) + "\n";
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
std::function<void(int)> LastWords(const std::string& command, bool json, const std::vector<std::string>& argv) {
  const auto start = std::chrono::steady_clock::now();
  return [=](int signal) {
    LineOutcome outcome;
    outcome.command = command;
    outcome.result = InterruptedResult(signal);
    const double wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    outcome.json = ResultToJson(command, outcome.result, wall_s, argv);
    Print(outcome, json);
  };
}

int Main(int argc, char** argv) {
  const std::vector<std::string> words(argv + 1, argv + argc);
  GlobalOptions global;
  const LineOutcome outcome = RunLine(words, global, [&](const Registry::Entry& entry) {
    InstallLog(global.log_level);
    InstallSignalHandlers(LastWords(entry.name, global.json, {argv, argv + argc}));
    const std::unique_ptr<ProgressSink> progress = MakeProgress(global.progress);
    CommandContext context{{progress.get(), global.threads, global.seed}, {argv, argv + argc}};
    return entry.run(context);
  });
  ClaimOutput();
  return Print(outcome, global.json);
}

}  // namespace
}  // namespace mvstudio::cli

int main(int argc, char** argv) {
  mvstudio::cli::PrepareProcess();
  if (mvstudio::cli::Trains(argv)) {
    mvstudio::cli::RestartWithShortSpins(argv);
    mvstudio::cli::KeepFreedMemory();
  }
  return mvstudio::cli::Main(argc, argv);
}
