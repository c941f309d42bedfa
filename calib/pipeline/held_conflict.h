#pragma once

#include <string>

#include "calib/calibrate.h"

namespace mvstudio::calib {

/// Tests whether the boards contradict a lens or pose that CalibrateOptions::fix keeps as given. Everything is calibrated
/// again with nothing fixed. There is a contradiction if only this calibration has a solution. The other case: it explains
/// the corners better than the freed parameters cost (Schwarz's criterion, and 3 standard errors over the views), and a
/// camera's error falls by a tenth.
///
/// The returned line names the given lens (by its projections) or pose (by the mean over the other cameras) that changes
/// most. Empty: no contradiction, or no solution with nothing fixed.
std::string FindHeldConflict(const CalibrateInput& input, const CalibrateReport& solved, const CalibrateOptions& options,
                             const RunContext& run);

}  // namespace mvstudio::calib
