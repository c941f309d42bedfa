#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace mvstudio::stages {

/// Number, size and digest of a file, or of all files of a folder, for provenance. Too much data is described by its size
/// alone. Never throws: what cannot be read (no right to, a loop of links, gone meanwhile, a pipe) is named as "error".
nlohmann::ordered_json Fingerprint(const std::string& path);

}  // namespace mvstudio::stages
