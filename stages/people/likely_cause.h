#pragma once

#include <string>

#include "stages/result.h"
#include "triangulate/take/cause.h"

/// Messages for takes of which almost nothing fits the calibration.
namespace mvstudio::stages {

/// A take counts as lost below this fraction of the joints that could be triangulated. Joints that only one camera sees do
/// not count, also in takes where that is the case for most people.
inline constexpr double kLostShare = 0.5;

/// Adds metrics["causes"], and the warning `code` where an assumption clearly explains the loss. Returns its remedy, or
/// `otherwise`, after a warning of what the best assumptions would leave.
std::string AddLikelyCause(const triangulate::CauseReport& report, const std::string& code, const std::string& otherwise,
                           CommandResult* result);

/// Adds what CheckTiming found, if it is clear: an error (TRI-TIMING, kExitQualityGate), or a warning where cameras differ by
/// less than half a frame, which footage without a common trigger does, or where the offset is sure but changes the
/// residuals by 5 % and more, but little (the motion is slow). `timed`: offsets were given. True when it is clear.
bool AddTiming(const triangulate::CauseReport& report, bool timed, CommandResult* result);

/// The same where a camera fits no point of the others: a clear cause of another kind is an error (TRI-CAUSE,
/// kExitQualityGate), but for a camera that moved.
bool AddCameraCause(const triangulate::CauseReport& report, bool timed, CommandResult* result);

}  // namespace mvstudio::stages
