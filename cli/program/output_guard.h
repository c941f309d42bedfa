#pragma once

#include <string>
#include <vector>

#include "core/disk/output.h"
#include "stages/words.h"

namespace mvstudio::cli {

/// Paths alone, for the check that no output is an input.
std::vector<std::string> PathsIn(const std::vector<stages::NamedPath>& named);

/// All of them, one after the other.
std::vector<std::string> Joined(std::vector<std::string> first, const std::vector<std::string>& second);

}  // namespace mvstudio::cli
