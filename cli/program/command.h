#pragma once

#include <functional>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "app/result.h"
#include "app/words.h"
#include "core/progress.h"

namespace CLI {
class App;
}

namespace mvstudio::cli {

using app::CommandResult;
using app::ExitCode;
using app::FiniteOrNull;
using app::kExitBadInput;
using app::kExitIllPosed;
using app::kExitInternal;
using app::kExitInterrupted;
using app::kExitMissingTool;
using app::kExitOk;
using app::kExitPartial;
using app::kExitQualityGate;
using app::kExitResources;
using app::kExitTryAgain;
using app::kExitUsage;
using app::ParseRanges;
using app::RangesText;
using app::SplitNamePath;

struct CommandContext {
  RunContext run;                 ///< progress, threads, seed
  std::vector<std::string> argv;  ///< as typed
  /// Of the dataset that the command reads, app::StudioNames: its result, or what it fails with, calls the cameras so.
  std::map<std::string, std::string> camera_names = {};
};

using RunCommand = std::function<CommandResult(CommandContext&)>;

/// Where commands register: `registry.Add(app.add_subcommand(...), "calib convert", run)`.
class Registry {
 public:
  void Add(CLI::App* sub, const std::string& name, RunCommand run) { entries_.push_back({sub, name, std::move(run)}); }
  struct Entry {
    CLI::App* app;
    std::string name;
    RunCommand run;
  };
  const std::vector<Entry>& entries() const { return entries_; }

 private:
  std::vector<Entry> entries_;
};

/// All commands that this program has (cli/commands.cc).
void RegisterAll(CLI::App& app, Registry& registry);

}  // namespace mvstudio::cli
