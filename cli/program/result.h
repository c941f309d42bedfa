#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "cli/program/command.h"

namespace mvstudio::cli {

/// The object of the command-line contract: schema, command, version, status, exit, metrics, outputs, warnings, errors, timing.
nlohmann::ordered_json ResultToJson(const std::string& command, const CommandResult& result, double wall_s,
                                    const std::vector<std::string>& argv);

/// What ResultToJson made of a result. Throws the library's exception for another object.
CommandResult ResultFromJson(const nlohmann::ordered_json& json, int exit);

/// The text that is printed and kept.
std::string JsonText(const nlohmann::ordered_json& json);

/// Keeps `<folder>/<command>.result.json` and appends a line to `<folder>/provenance.jsonl` (argv, version, hashes, time),
/// redacted when that was asked for. `record`: of RecordOfLine. Returns the result; where that fails, with a warning, and for a
/// full disk as a failure.
CommandResult Kept(const std::string& command, CommandResult result, const nlohmann::ordered_json& json,
                   const std::vector<std::string>& argv, const nlohmann::ordered_json& record);

/// Turns the exception being handled into an error result with the exit code of its type.
CommandResult ResultOfCurrentException();

/// Of a command that was asked to stop by a signal; 0: by something else.
CommandResult InterruptedResult(int signal, const std::string& text = "interrupted");

}  // namespace mvstudio::cli
