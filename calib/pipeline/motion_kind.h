#pragma once

#include <optional>
#include <string>

#include "calib/calibrate.h"

namespace mvstudio::calib {

/// Decides whether the camera of a motion moved or its lens changed. The camera is split at the motion and the rig
/// adjusted again from `solved`, with one lens for both parts and with a lens for each. The lens changed if a second one
/// explains the corners better than its parameters cost (Schwarz, "Estimating the dimension of a model", 1978) and by 2
/// standard errors over the views. The motion then holds the amount, and the camera for which this holds best. Unchanged
/// when there is no solution.
void ExplainMotion(const CalibrateInput& input, const CalibrateReport& solved, const CalibrateOptions& options,
                   const RunContext& run, CameraMotion* motion);

/// Searches for a lens change of a camera that contradicts the others and that no motion explains. The cut at which one
/// lens per part explains most is searched at eighths of its frames, then refined, and judged as in ExplainMotion.
/// `shift_px` is the increase of the camera's error in the rig.
std::optional<CameraMotion> FindLensChange(const CalibrateInput& input, const CalibrateReport& solved, const CalibrateOptions& options,
                                           const RunContext& run, const std::string& camera);

}  // namespace mvstudio::calib
