#pragma once

#include <functional>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/progress.h"
#include "stages/result.h"
#include "stages/words.h"

namespace CLI {
class App;
}

namespace mvstudio::cli {

using stages::CommandResult;
using stages::ExitCode;
using stages::FiniteOrNull;
using stages::kExitBadInput;
using stages::kExitIllPosed;
using stages::kExitInternal;
using stages::kExitInterrupted;
using stages::kExitMissingTool;
using stages::kExitOk;
using stages::kExitPartial;
using stages::kExitQualityGate;
using stages::kExitResources;
using stages::kExitTryAgain;
using stages::kExitUsage;
using stages::ParseRanges;
using stages::RangesText;

struct CommandContext {
  RunContext run;                 ///< progress, threads, seed
  std::vector<std::string> argv;  ///< as typed
  /// Of the dataset that the command reads, stages::StudioNames: its result, or what it fails with, calls the cameras so.
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
