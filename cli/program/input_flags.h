#pragma once

#include <string>

#include "app/input/calib_read.h"
#include "app/input/corner_input.h"
#include "app/input/pose_input.h"
#include "app/input/session_input.h"
#include "app/input/take_input.h"

namespace CLI {
class App;
}

/// The flags of inputs that several commands share.
namespace mvstudio::cli {

/// --from, --size, --unit, --qca-distortion-divisor, --lens, --invert, --mirror, --allow-approximation.
void AddReadOptions(CLI::App* sub, app::CalibReadOptions& options);
/// Of these --lens, --invert, --mirror, --allow-approximation: what a file's numbers mean.
void AddMeaningOptions(CLI::App* sub, app::CalibReadOptions& options);
/// --invert, --mirror.
void AddPoseMendingOptions(CLI::App* sub, bool& invert, bool& mirror);

/// Adds --video, --images, --plate, --session, --take and --allow-outside.
void AddTakeArguments(CLI::App* sub, app::TakeArguments& arguments);

/// Adds --session, --take and --allow-outside; `what` comes from the session, `unless_given` is the take without --take.
void AddSessionArguments(CLI::App* sub, app::SessionArguments& arguments, const std::string& what,
                         const std::string& unless_given);

/// Adds --skeleton: a known name or a file; `what` begins the help.
void AddSkeletonOption(CLI::App* sub, std::string& skeleton, const std::string& what);

/// Adds what the numbers of 2D joints may mean: --normalized, --flip-y, --rotate, --rate, …
void AddPoseChanges(CLI::App* sub, app::PoseChanges& changes);

/// Adds --calib, --pose2d, --points2d, --skeleton and the changes.
void AddPoseArguments(CLI::App* sub, app::PoseArguments& arguments);

void AddCornerArguments(CLI::App* sub, app::CornerArguments& arguments);

}  // namespace mvstudio::cli
