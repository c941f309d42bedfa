#pragma once

#include <string>
#include <vector>

#include "app/result.h"
#include "calib/detect/detect_footage.h"

namespace mvstudio::app {

/// Opens the footage of `--camera NAME=PATH` options. Frames of an image camera are numbered by the last number in their
/// file names, those of a video by position. Adds the paths to result->inputs. Throws UsageError without cameras or for
/// one given twice.
std::vector<calib::Footage> OpenFootage(const std::vector<std::string>& cameras, CommandResult* result);

}  // namespace mvstudio::app
