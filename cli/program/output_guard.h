#pragma once

#include <string>
#include <vector>

#include "app/words.h"
#include "core/disk/output.h"
#include "dataset/build/build.h"

namespace mvstudio::cli {

/// Paths alone, for the check that no output is an input.
std::vector<std::string> PathsIn(const std::vector<app::NamedPath>& named);

/// Footage and plates.
std::vector<std::string> PathsOf(const std::vector<dataset::CameraFootage>& footage);

/// All of them, one after the other.
std::vector<std::string> Joined(std::vector<std::string> first, const std::vector<std::string>& second);

}  // namespace mvstudio::cli
