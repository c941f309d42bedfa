#pragma once

#include <string>
#include <vector>

#include "calib/calibrate.h"
#include "calib/check/seen_corners.h"

namespace mvstudio::calib {

/// A camera that is not calibrated while others are.
struct LeftOutCamera {
  std::string name, reason;
};

struct SolvableCalibration {
  CalibrateReport report;  ///< of the cameras in `kept`
  std::vector<int> kept;   ///< indices into CalibrateInput::cameras
  std::vector<LeftOutCamera> left_out;
};

/// The verdict is of the cameras that were calibrated: says which were not, before its other reasons. It passes no more.
void NameLeftOut(const std::vector<LeftOutCamera>& left_out, Verdict* verdict);

/// Calibrate; where that fails because of some cameras (CalibrateReport::suspects, or cameras without corners), the others
/// without them. Where the rest has no solution either, or an option names a camera that would be left out, the report is
/// that of all cameras with corners and `left_out` is empty.
SolvableCalibration CalibrateSolvable(const CalibrateInput& input, const CalibrateOptions& options, const RunContext& run);

}  // namespace mvstudio::calib
