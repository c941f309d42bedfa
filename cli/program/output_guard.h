#pragma once

#include <string>
#include <vector>

#include "core/disk/output.h"
#include "stages/result.h"
#include "stages/words.h"

namespace mvstudio::cli {

/// Paths alone, for the check that no output is an input.
std::vector<std::string> PathsIn(const std::vector<stages::NamedPath>& named);

/// True where `path` is there and the run ended in failure (exit code 5): the older result is the better one. It is then said,
/// and the result's folder stays as it is.
bool KeepsOlder(const std::string& path, stages::CommandResult* result);

/// All of them, one after the other.
std::vector<std::string> Joined(std::vector<std::string> first, const std::vector<std::string>& second);

}  // namespace mvstudio::cli
