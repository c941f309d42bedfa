#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "cli/command.h"

namespace mvstudio::cli {

/// The object of the command-line contract: schema, command, version, status, exit, metrics, outputs, warnings, errors, timing.
nlohmann::ordered_json ResultToJson(const std::string& command, const CommandResult& result, double wall_s,
                                    const std::vector<std::string>& argv);

/// Keeps `<folder>/<command>.result.json` and appends a line to `<folder>/provenance.jsonl` (argv, version, hashes, time).
void KeepResult(const std::string& command, const CommandResult& result, const nlohmann::ordered_json& json,
                const std::vector<std::string>& argv);

/// Turns the exception being handled into an error result with the exit code of its type.
CommandResult ResultOfCurrentException();

}  // namespace mvstudio::cli
