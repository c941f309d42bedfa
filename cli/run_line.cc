#include "cli/run_line.h"

#include <chrono>

#include "cli/commands.h"
#include "cli/result.h"

namespace mvstudio::cli {
namespace {

using Clock = std::chrono::steady_clock;

void AddGlobalOptions(CLI::App& app, GlobalOptions& global) {
  app.add_flag("--json", global.json, "print exactly one JSON object on stdout");
  app.add_option("--threads", global.threads, "threads; 0: as many as the machine has")->capture_default_str();
  app.add_option("--seed", global.seed, "seed of everything random")->capture_default_str();
  app.add_option("--log-level", global.log_level, "debug, info, warning, error or off")->capture_default_str();
  app.add_option("--progress", global.progress, "auto, bar, plain or none")->capture_default_str();
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

void FinishOutcome(LineOutcome& outcome, double wall_s, const std::vector<std::string>& argv) {
  outcome.json = ResultToJson(outcome.command, outcome.result, wall_s, argv);
  try {
    KeepResult(outcome.command, outcome.result, outcome.json, argv);
  } catch (...) {
    outcome.result = ResultOfCurrentException();
    outcome.json = ResultToJson(outcome.command, outcome.result, wall_s, argv);
  }
}

}  // namespace

LineOutcome RunLine(const std::vector<std::string>& words, GlobalOptions& global,
                    const std::function<CommandResult(const RunCommand&)>& run) {
  CLI::App app{"mvstudio: multi-view capture, from footage to scored avatars", "mvstudio"};
  app.fallthrough();
  app.require_subcommand(1);
  AddGlobalOptions(app, global);
  Registry registry;
  RegisterAll(app, registry);

  std::vector<std::string> argv = {"mvstudio"};
  argv.insert(argv.end(), words.begin(), words.end());
  LineOutcome outcome;
  const auto start = Clock::now();
  try {
    app.parse(std::vector<std::string>(words.rbegin(), words.rend()));  // CLI11 takes the words last first
    const Registry::Entry* entry = Chosen(registry);
    if (entry) outcome.command = entry->name;
    outcome.result = entry ? run(entry->run) : UsageResult("no command given");
  } catch (const CLI::CallForHelp&) {
    outcome.help = app.help();
  } catch (const CLI::CallForAllHelp&) {
    outcome.help = app.help("", CLI::AppFormatMode::All);
  } catch (const CLI::ParseError& e) {
    for (const std::string& word : words) global.json = global.json || word == "--json";
    outcome.result = UsageResult(e.what());
  } catch (...) {
    outcome.result = ResultOfCurrentException();
  }
  FinishOutcome(outcome, std::chrono::duration<double>(Clock::now() - start).count(), argv);
  return outcome;
}

LineOutcome RunStage(const std::vector<std::string>& words, const CommandContext& context) {
  GlobalOptions global;
  global.threads = context.run.num_threads;
  global.seed = context.run.seed;
  std::vector<std::string> argv = {"mvstudio"};
  argv.insert(argv.end(), words.begin(), words.end());
  return RunLine(words, global, [&](const RunCommand& command) {
    CommandContext stage{{context.run.progress, global.threads, global.seed}, argv};
    return command(stage);
  });
}

}  // namespace mvstudio::cli
