#pragma once

#include <vector>

#include "triangulate/point/prepared_rig.h"
#include "triangulate/point/types.h"

namespace mvstudio::triangulate {

/// Adds the calibration's own uncertainty to a triangulated point's covariance: G S G^T. S is the joint covariance of
/// lenses and poses of the cameras used for the point. By the implicit function theorem at the weighted least-squares
/// point, G = -C sum J_x^T J_theta / s^2, with C the covariance from the detections alone (first order; Haralick,
/// "Propagating covariance in computer vision", 1996).
///
/// Errors of the calibration are common to all points: averaging points does not lower them. The gauge is the
/// calibration's. A camera that lacks a covariance block contributes what it has and is counted in
/// Point::num_unknown_cameras: the sum is then a lower bound. Only counts these cameras when the rig states no covariance
/// at all. No effect when the status is not kOk.
void AddCalibrationCovariance(const PreparedRig& rig, const std::vector<Observation>& observations, Point* point);

/// Derivatives of a point's projection: `out` (2, P + 6) by the camera's lens parameters and pose (left perturbation of
/// cam_from_world), zero before; `by_x` by the point. False where the lens's formula is undefined.
bool ProjectionByCalibration(const PreparedRig& rig, size_t camera_idx, const Eigen::Vector3d& x_in_world,
                             Eigen::Ref<Eigen::MatrixXd> out, Eigen::Matrix<double, 2, 3>* by_x);

}  // namespace mvstudio::triangulate
