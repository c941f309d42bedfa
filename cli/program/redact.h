#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace mvstudio::cli {

/// From now on results, provenance and reports leave out who ran the program and where (--redact). `argv`: its paths are known
/// by their full length, so that spaces in them do no harm.
void StartRedacting(const std::vector<std::string>& argv);
bool Redacting();

/// `text` as it is; once redacting, with absolute paths shortened (the current folder is left out, the home folder is ~, of
/// others the last name stays: …/name), and the names of the user and of the machine replaced by `user` and `host`.
std::string Redacted(const std::string& text);

/// Whole paths among the strings of `json` are then known by their full length, too.
void KnowPaths(const nlohmann::ordered_json& json);

/// The same for every string of a result or a line of provenance; names of commands and codes stay.
nlohmann::ordered_json RedactedJson(nlohmann::ordered_json json);

}  // namespace mvstudio::cli
