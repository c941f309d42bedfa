#pragma once

#include <vector>

#include "calib/calibrate.h"

namespace mvstudio::calib {

/// Gain of `rich` over `lean` for each view: squared errors of lean's corners minus those of rich's, in rich's standard
/// deviations of each camera, gross errors capped at 6. For views in both, by camera and frame. For GainBeyondCost.
std::vector<double> ChiSquaredGain(const CalibrateReport& lean, const CalibrateReport& rich);

}  // namespace mvstudio::calib
