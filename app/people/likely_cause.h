#pragma once

#include <string>

#include "app/result.h"
#include "triangulate/take/cause.h"

/// What is said when hardly anything of a take fits its calibration.
namespace mvstudio::app {

/// Below this part of what could be carried a take counts as lost. Wrong files leave 0 to 2 %; takes in which most people are
/// seen by one camera alone do not count what one camera sees.
inline constexpr double kLostShare = 0.05;

/// metrics["causes"], and the warning `code` where an assumption explains the loss clearly. Returns its remedy, or `otherwise`.
std::string AddLikelyCause(const triangulate::CauseReport& report, const std::string& code, const std::string& otherwise,
                           CommandResult* result);

}  // namespace mvstudio::app
