#pragma once

#include <string>

#include "stages/input/calib_read.h"
#include "stages/input/pose_input.h"

namespace CLI {
class App;
}

/// The flags of inputs that several commands share.
namespace mvstudio::cli {

/// --from, --size, --unit, --qca-distortion-divisor, --lens, --invert, --mirror, --allow-approximation.
void AddReadOptions(CLI::App* sub, stages::CalibReadOptions& options);
/// Of these --lens, --invert, --mirror, --allow-approximation: what a file's numbers mean.
void AddMeaningOptions(CLI::App* sub, stages::CalibReadOptions& options);

/// Adds --calib, which is required, --pose2d, --points2d, --skeleton and the changes.
void AddPoseArguments(CLI::App* sub, stages::PoseArguments& arguments);

}  // namespace mvstudio::cli
