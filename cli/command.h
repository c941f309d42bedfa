#pragma once

#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/progress.h"

namespace CLI {
class App;
}

namespace mvstudio::cli {

/// Exit codes of the command-line contract.
enum ExitCode {
  kExitOk = 0,
  kExitInternal = 1,
  kExitUsage = 2,
  kExitBadInput = 3,
  kExitQualityGate = 4,  ///< computed, outputs kept, but a quality gate failed
  kExitIllPosed = 5,     ///< ill-posed or not converged
  kExitPartial = 6,      ///< some cameras or frames failed; they are listed
  kExitResources = 7,
  kExitMissingTool = 8,
  kExitTryAgain = 75,
  kExitInterrupted = 130,
};

/// A warning or an error of a result: a stable code (`CAL-LOWCOV`), what and where, and what to do about it.
struct Notice {
  std::string code, text, hint;
};

/// What a command returns. Exceptions become an `error` result with the exit code of their type.
struct CommandResult {
  int exit = kExitOk;
  nlohmann::ordered_json metrics = nlohmann::ordered_json::object();
  struct Output {
    std::string path;
    std::string role;  ///< "calibration", "points", "dataset", "checkpoint", "heldout-picture", …; may be empty
  };
  std::vector<Output> outputs;
  std::vector<Notice> warnings;
  std::vector<Notice> errors;
  std::string text;  ///< what a person reads on stdout without --json
  std::string
      folder;  ///< when set: the whole result is kept as folder/<command>.result.json and provenance.jsonl gets a line there
  std::vector<std::string> inputs;  ///< files and folders read, for provenance
};

struct CommandContext {
  RunContext run;                 ///< progress, threads, seed
  std::vector<std::string> argv;  ///< as typed
};

using RunCommand = std::function<CommandResult(CommandContext&)>;

/// Where commands register: `registry.Add(app.add_subcommand(...), "calib convert", run)`.
class Registry {
 public:
  void Add(CLI::App* sub, const std::string& name, RunCommand run);
  struct Entry {
    CLI::App* app;
    std::string name;
    RunCommand run;
  };
  const std::vector<Entry>& entries() const { return entries_; }

 private:
  std::vector<Entry> entries_;
};

/// One line each in commands.cc; defined in command_<name>.cc.
void RegisterAll(CLI::App& app, Registry& registry);

/// JSON has no NaN and no infinity: null where the value is not finite.
nlohmann::ordered_json FiniteOrNull(double value);

/// Splits "name=path"; throws UsageError naming `flag` when there is no '='.
std::pair<std::string, std::string> SplitNamePath(const std::string& flag, const std::string& text);

/// Parses "80-99" or "1,4,7-9" into sorted numbers; throws UsageError.
std::vector<int> ParseRanges(const std::string& flag, const std::string& text);
/// The shortest text that ParseRanges turns into these sorted numbers: "1,4,7-9".
std::string RangesText(const std::vector<int>& numbers);

}  // namespace mvstudio::cli
