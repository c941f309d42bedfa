#pragma once

#include <vector>

#include "calib/bundle/view.h"

namespace mvstudio::calib {

/// Appends the errors (px) of a lens on a board that was not used to estimate it. `near_pose` is the approximate pose of
/// the board in the camera: it selects between the two similar poses of a plane, which the corners often cannot.
///
/// From 8 corners on: the pose from every second corner, robustly, and the errors of the others; then with the halves
/// exchanged. Excluded are corners whose predicted position is not accurate to about the noise of one corner. From 4 to 7
/// corners: residuals of the pose from all of them, studentised by the variance that the fit left (Cook and Weisberg,
/// "Residuals and influence in regression", 1982).
///
/// A view without a pose has infinite errors.
void AppendHeldOutErrors(const geometry::Camera& camera, const View& view, const RigState& state,
                         const geometry::Rigid3& near_pose, std::vector<double>* errors_px);

/// Appends the errors (px) of points of a view that were left out of the lens and of its pose, a fifth at a time. `camera`
/// is the solution of all.
void AppendLeftOutPoints(const geometry::Camera& camera, const View& view, std::vector<double>* errors_px);

}  // namespace mvstudio::calib
