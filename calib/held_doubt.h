#pragma once

#include <string>

#include "calib/calibrate.h"

namespace mvstudio::calib {

/// Do the boards contradict a lens or pose that CalibrateOptions::fix holds as it was given? Everything is calibrated again with
/// nothing held. Where that gives a solution at all, or explains the corners better than the held numbers cost (Schwarz's criterion, and
/// 3 standard errors over the views) and a camera's error falls by a tenth, one line names the given lens (by its projections) or pose
/// (by the mean over the other cameras) that changes most. Empty: they do not, or there is no solution
/// with nothing held.
std::string FindHeldDoubt(const CalibrateInput& input, const CalibrateReport& solved, const CalibrateOptions& options,
                          const RunContext& run);

}  // namespace mvstudio::calib
