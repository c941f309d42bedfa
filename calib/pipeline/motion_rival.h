#pragma once

#include "calib/calibrate.h"

namespace mvstudio::calib {

/// A motion is found camera by camera, the others held. Where the camera that moved links others that hardly see a board
/// together, its neighbour seems to move instead. If boards of other cameras stay rejected as a whole with `motion` taken into
/// account, each other camera is split at that time instead, and the one that leaves fewest boards rejected and the least error
/// is named. Left as it is where nothing does better.
void NameCameraThatMoved(const CalibrateInput& input, const CalibrateReport& solved, const CalibrateOptions& options,
                         const RunContext& run, CameraMotion* motion);

}  // namespace mvstudio::calib
