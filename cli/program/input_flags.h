#pragma once

#include <string>

#include "stages/input/calib_read.h"
#include "stages/input/pose_input.h"
#include "stages/input/session_input.h"

namespace CLI {
class App;
}

/// The flags of inputs that several commands share.
namespace mvstudio::cli {

/// --from, --size, --unit, --qca-distortion-divisor, --lens, --invert, --mirror, --allow-approximation.
void AddReadOptions(CLI::App* sub, stages::CalibReadOptions& options);
/// Of these --lens, --invert, --mirror, --allow-approximation: what a file's numbers mean.
void AddMeaningOptions(CLI::App* sub, stages::CalibReadOptions& options);

/// Adds --session, --take and --allow-outside; `what` comes from the session, `unless_given` is the take without --take.
void AddSessionArguments(CLI::App* sub, stages::SessionArguments& arguments, const std::string& what,
                         const std::string& unless_given);

/// Adds --calib, which is required, --pose2d, --points2d, --skeleton and the changes.
void AddPoseArguments(CLI::App* sub, stages::PoseArguments& arguments);

}  // namespace mvstudio::cli
