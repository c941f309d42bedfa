#pragma once

#include <vector>

#include "calib/bundle/view.h"

namespace mvstudio::calib {

/// Appends the errors (px) that a lens leaves on a board that took no part in its estimation; `near_pose` is about where the
/// board is in the camera: of the two poses of a plane that may look alike, the corners that give the pose often tell none.
/// From 8 corners on: the pose from every second corner, robustly, the errors of the others, and the same with the halves
/// swapped. Corners whose place that pose does not determine to about the noise of one corner say nothing about the lens and are
/// left out. From 4 to 7 corners: residuals of the pose from all of them, each times the root of the inverse of what the fit left
/// of its variance (Cook and Weisberg, "Residuals and influence in regression", 1982, studentised residuals).
/// A view without a pose has infinite errors.
void AppendHeldOutErrors(const geometry::Camera& camera, const View& view, const RigState& state,
                         const geometry::Rigid3& near_pose, std::vector<double>* errors_px);

}  // namespace mvstudio::calib
