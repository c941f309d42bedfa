#pragma once

#include <optional>
#include <string>

#include "calib/calibrate.h"

namespace mvstudio::calib {

/// Did the camera of a motion turn, or did its lens change? The camera is split at the motion and the rig adjusted again from
/// `solved`: once with one lens for both parts, once with a lens for each. A lens changed when a second one explains the corners
/// better than its numbers cost (Schwarz, "Estimating the dimension of a model", 1978) and by 2 standard errors over the views;
/// the motion then says by how much, and names the camera for which that holds best. Left as it is when there is no solution.
void ExplainMotion(const CalibrateInput& input, const CalibrateReport& solved, const CalibrateOptions& options,
                   const RunContext& run, CameraMotion* motion);

/// Did the lens of a camera that contradicts the others change, where no motion explains it? The cut at which a lens for each
/// part explains most is searched at eighths of its frames, then nearer and nearer, and judged as in ExplainMotion; `shift_px` is
/// what the rig adds to the camera's error.
std::optional<CameraMotion> FindLensChange(const CalibrateInput& input, const CalibrateReport& solved, const CalibrateOptions& options,
                                           const RunContext& run, const std::string& camera);

}  // namespace mvstudio::calib
