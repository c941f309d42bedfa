#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "cli/program/command.h"

namespace mvstudio::cli {

struct GlobalOptions {
  bool json = false;
  int threads = 0;
  uint64_t seed = 1;
  std::string log_level = "warning";
  std::string progress = "auto";
  bool redact = false, quiet = false;
};

/// The outcome of one command line: what was run, its result, and the JSON object of the contract.
struct LineOutcome {
  std::string command;
  CommandResult result;
  nlohmann::ordered_json json;
  nlohmann::ordered_json record;  ///< of RecordOfLine
  std::string help;               ///< text of --help when that was asked for; nothing was run then
};

/// Runs a command's entry, with a context that it completes.
using RunEntry = std::function<CommandResult(const Registry::Entry&, CommandContext&)>;

/// Parses `words` (without the program's name) and fills `global`; the chosen command is then called by `run`. Never throws:
/// whatever goes wrong is in the result. The result is kept in its folder.
LineOutcome RunLine(const std::vector<std::string>& words, GlobalOptions& global, const RunEntry& run);

}  // namespace mvstudio::cli
