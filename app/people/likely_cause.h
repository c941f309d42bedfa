#pragma once

#include <string>

#include "app/result.h"
#include "triangulate/take/cause.h"

/// Messages for takes of which almost nothing fits the calibration.
namespace mvstudio::app {

/// A take counts as lost below this fraction of the joints that could be triangulated. Wrong files leave 0 to 2 %. Joints
/// that only one camera sees do not count, also in takes where that is the case for most people.
inline constexpr double kLostShare = 0.05;

/// Adds metrics["causes"], and the warning `code` where an assumption clearly explains the loss. Returns its remedy, or
/// `otherwise`.
std::string AddLikelyCause(const triangulate::CauseReport& report, const std::string& code, const std::string& otherwise,
                           CommandResult* result);

/// Adds what CheckTiming found, if it is clear: an error (TRI-TIMING, kExitQualityGate), or a warning where cameras differ by
/// less than half a frame, which footage without a common trigger does, or where the offset is sure but changes the
/// residuals little (the motion is slow). True when it is clear.
bool AddTiming(const triangulate::CauseReport& report, CommandResult* result);

}  // namespace mvstudio::app
