#pragma once

#include <string>

#include "calib/calibrate.h"

namespace mvstudio::calib {

/// Do the boards contradict a lens or pose that CalibrateOptions::fix holds as it was given? Everything is calibrated again with
/// nothing held. They do where that alone gives a solution, or where it explains the corners better than the held numbers cost
/// (Schwarz's criterion, and 3 standard errors over the views) and a camera's error falls by a tenth. The line names the given lens (by
/// its projections) or pose (by the mean over the other cameras) that changes most. Empty: they do not, or nothing held has no solution.
std::string FindHeldDoubt(const CalibrateInput& input, const CalibrateReport& solved, const CalibrateOptions& options,
                          const RunContext& run);

}  // namespace mvstudio::calib
