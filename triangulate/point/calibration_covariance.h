#pragma once

#include <vector>

#include "triangulate/point/prepared_rig.h"
#include "triangulate/point/types.h"

namespace mvstudio::triangulate {

/// Adds to a triangulated point's covariance what the calibration's own uncertainty gives: G S G^T with S the joint covariance
/// of lenses and poses of the cameras that carry the point and, by the implicit function theorem at the weighted least-squares
/// point, G = -C sum J_x^T J_theta / s^2, C the covariance from the detections alone (first order; Haralick, "Propagating
/// covariance in computer vision", 1996). Errors of the calibration are shared by all points: averaging points does not lower
/// them. The gauge is the calibration's. A camera that lacks a covariance block adds what it has and is counted in
/// Point::num_unknown_cameras: the sum is then a lower bound. Does nothing else when the rig carries no covariance at all, and
/// nothing when the status is not kOk.
void AddCalibrationCovariance(const PreparedRig& rig, const std::vector<Observation>& observations, Point* point);

}  // namespace mvstudio::triangulate
