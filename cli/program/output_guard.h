#pragma once

#include <string>
#include <vector>

#include "core/disk/output.h"
#include "dataset/build/build.h"

namespace mvstudio::cli {

/// The paths in words such as `cam_01=videos/cam_01.mp4` or `corners.vnl`, for the check that no output is an input.
std::vector<std::string> PathsIn(const std::vector<std::string>& words);

/// Footage and plates.
std::vector<std::string> PathsOf(const std::vector<dataset::CameraFootage>& footage);

/// All of them, one after the other.
std::vector<std::string> Joined(std::vector<std::string> first, const std::vector<std::string>& second);

}  // namespace mvstudio::cli
