#pragma once

#include <vector>

#include "calib/calibrate.h"

namespace mvstudio::calib {

/// What `rich` explains better than `lean`, view by view: squared errors of lean's corners less those of rich's, in rich's standard
/// deviations of each camera, gross errors capped at 6. Views of both, by camera and frame. For GainBeyondCost.
std::vector<double> SquaresLess(const CalibrateReport& lean, const CalibrateReport& rich);

}  // namespace mvstudio::calib
