#include <chrono>
#include <iostream>

#include "cli/commands.h"
#include "cli/console.h"
#include "cli/result.h"

namespace mvstudio::cli {
namespace {

struct GlobalOptions {
  bool json = false;
  int threads = 0;
  uint64_t seed = 1;
  std::string log_level = "warning";
  std::string progress = "auto";
};

void AddGlobalOptions(CLI::App& app, GlobalOptions& global) {
  app.add_flag("--json", global.json, "print exactly one JSON object on stdout");
  app.add_option("--threads", global.threads, "threads; 0: as many as the machine has")->capture_default_str();
  app.add_option("--seed", global.seed, "seed of everything random")->capture_default_str();
  app.add_option("--log-level", global.log_level, "debug, info, warning, error or off")->capture_default_str();
  app.add_option("--progress", global.progress, "auto, bar, plain or none")->capture_default_str();
}

void PrintForPerson(const CommandResult& result) {
  if (!result.text.empty()) std::cout << result.text << (result.text.back() == '\n' ? "" : "\n");
  for (const Notice& notice : result.warnings) {
    std::cerr << "warning " << notice.code << ": " << notice.text << (notice.hint.empty() ? "" : " (" + notice.hint + ")") << "\n";
  }
  for (const Notice& notice : result.errors) {
    std::cerr << "error: " << notice.text << (notice.hint.empty() ? "" : " (" + notice.hint + ")") << "\n";
  }
  for (const auto& output : result.outputs) {
    if (output.role != "heldout-picture") std::cout << "Wrote " << output.path << "\n";
  }
}

int Finish(const std::string& command, CommandResult result, const GlobalOptions& global, double wall_s,
           const std::vector<std::string>& argv) {
  nlohmann::ordered_json json = ResultToJson(command, result, wall_s, argv);
  try {
    KeepResult(command, result, json, argv);
  } catch (...) {
    result = ResultOfCurrentException();
    json = ResultToJson(command, result, wall_s, argv);
  }
  if (global.json) {
    std::cout << json.dump(1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) << std::endl;
    for (const Notice& notice : result.errors) std::cerr << "error: " << notice.text << "\n";
  } else {
    PrintForPerson(result);
  }
  return result.exit;
}

const Registry::Entry* Chosen(const Registry& registry) {
  for (const auto& entry : registry.entries()) {
    if (entry.app->parsed()) return &entry;
  }
  return nullptr;
}

CommandResult UsageResult(const std::string& text) {
  CommandResult result;
  result.exit = kExitUsage;
  result.errors.push_back({"CLI-USAGE", text, "see mvstudio --help"});
  return result;
}

int Main(int argc, char** argv) {
  const std::vector<std::string> words(argv, argv + argc);
  GlobalOptions global;
  CLI::App app{"mvstudio: multi-view capture, from footage to scored avatars", "mvstudio"};
  app.fallthrough();
  app.require_subcommand(1);
  AddGlobalOptions(app, global);
  Registry registry;
  RegisterAll(app, registry);
  try {
    app.parse(argc, argv);
  } catch (const CLI::Success& e) {
    return app.exit(e);
  } catch (const CLI::ParseError& e) {
    for (const std::string& word : words) global.json = global.json || word == "--json";
    return Finish("", UsageResult(e.what()), global, 0, words);
  }

  const auto start = std::chrono::steady_clock::now();
  const Registry::Entry* entry = Chosen(registry);
  CommandResult result;
  try {
    InstallLog(global.log_level);
    InstallSignalHandlers();
    const std::unique_ptr<ProgressSink> progress = MakeProgress(global.progress);
    CommandContext context{{progress.get(), global.threads, global.seed}, words};
    result = entry ? entry->run(context) : UsageResult("no command given");
  } catch (...) {
    result = ResultOfCurrentException();
  }
  const double wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return Finish(entry ? entry->name : "", result, global, wall_s, words);
}

}  // namespace
}  // namespace mvstudio::cli

int main(int argc, char** argv) { return mvstudio::cli::Main(argc, argv); }
