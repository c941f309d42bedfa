#include <malloc.h>
#include <unistd.h>

#include <cstdlib>
#include <cstring>
#include <iostream>

#include "cli/console.h"
#include "cli/run_line.h"

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

void PrintForPerson(const CommandResult& result) {
  if (!result.text.empty()) std::cout << result.text << (result.text.back() == '\n' ? "" : "\n");
  for (const Notice& notice : result.warnings) {
    std::cerr << OneLine("warning " + notice.code + ": " + WithHint(notice)) << "\n";
  }
  for (const auto& output : result.outputs) {
    if (output.role != "heldout-picture") std::cout << "Wrote " << output.path << "\n";
  }
}

void PrintErrors(const CommandResult& result) {
  for (const Notice& notice : result.errors) {
    std::cerr << OneLine("error: " + WithHint(notice)) << "\n";
  }
}

int Main(int argc, char** argv) {
  const std::vector<std::string> words(argv + 1, argv + argc);
  GlobalOptions global;
  const LineOutcome outcome = RunLine(words, global, [&](const RunCommand& command) {
    InstallLog(global.log_level);
    InstallSignalHandlers();
    const std::unique_ptr<ProgressSink> progress = MakeProgress(global.progress);
    CommandContext context{{progress.get(), global.threads, global.seed}, {argv, argv + argc}};
    return command(context);
  });
  if (!outcome.help.empty()) {
    std::cout << outcome.help;
    return kExitOk;
  }
  PrintErrors(outcome.result);
  if (global.json) {
    std::cout << outcome.json.dump(1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) << std::endl;
  } else {
    PrintForPerson(outcome.result);
  }
  return outcome.result.exit;
}

}  // namespace
}  // namespace mvstudio::cli

int main(int argc, char** argv) {
  if (mvstudio::cli::Trains(argv)) {
    mvstudio::cli::RestartWithShortSpins(argv);
    mvstudio::cli::KeepFreedMemory();
  }
  return mvstudio::cli::Main(argc, argv);
}
