#include <iostream>

#include "cli/console.h"
#include "cli/run_line.h"

namespace mvstudio::cli {
namespace {

void PrintForPerson(const CommandResult& result) {
  if (!result.text.empty()) std::cout << result.text << (result.text.back() == '\n' ? "" : "\n");
  for (const Notice& notice : result.warnings) {
    std::cerr << "warning " << notice.code << ": " << notice.text << (notice.hint.empty() ? "" : " (" + notice.hint + ")") << "\n";
  }
  for (const auto& output : result.outputs) {
    if (output.role != "heldout-picture") std::cout << "Wrote " << output.path << "\n";
  }
}

void PrintErrors(const CommandResult& result) {
  for (const Notice& notice : result.errors) {
    std::cerr << "error: " << notice.text << (notice.hint.empty() ? "" : " (" + notice.hint + ")") << "\n";
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

int main(int argc, char** argv) { return mvstudio::cli::Main(argc, argv); }
