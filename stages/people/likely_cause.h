#pragma once

#include <optional>
#include <string>

#include "stages/result.h"
#include "triangulate/take/cause.h"

/// Messages for takes of which almost nothing fits the calibration.
namespace mvstudio::stages {

/// A take counts as lost below this fraction of the joints that could be triangulated. Joints that only one camera sees do
/// not count, also in takes where that is the case for most people.
inline constexpr double kLostShare = 0.5;

/// What is said of a cause.
struct CauseFinding {
  CommandResult said;
  bool clear = false;
  std::string remedy = {};  ///< what to do
};

/// metrics["causes"], and the warning `code` where an assumption clearly explains the loss, with its remedy. Else the remedy is
/// `otherwise`, after a warning of what the best assumptions would leave. Nothing is said without a report.
CauseFinding CauseOfLoss(const std::optional<triangulate::CauseReport>& report, const std::string& code,
                         const std::string& otherwise);

/// What CheckTiming found, if it is clear: an error (TRI-TIMING, kExitQualityGate), or a warning where cameras differ by
/// less than half a frame, which footage without a common trigger does, or where the offset is sure but changes the
/// residuals by 5 % and more, but little (the motion is slow). `timed`: offsets were given.
CauseFinding CauseInTiming(const triangulate::CauseReport& report, bool timed);

/// The same where a camera fits no point of the others: a clear cause of another kind is an error (TRI-CAUSE,
/// kExitQualityGate), but for a camera that moved.
CauseFinding CauseInCamera(const triangulate::CauseReport& report, bool timed);

/// Detections scatter more than they should, and yet points were found: a cause that halves what is left is an error, and a
/// camera without which a fifth is left; else what the motion says of the clocks.
CauseFinding CauseInScatter(const triangulate::CauseReport& report, bool timed);

}  // namespace mvstudio::stages
