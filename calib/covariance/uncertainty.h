#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "calib/bundle/bundle.h"
#include "calib/bundle/rig_problem.h"
#include "calib/covariance/held_covariance.h"
#include "core/status.h"
#include "geometry/rig/rig.h"

namespace mvstudio::calib {

/// Covariance of a solved rig, boards marginalised. What the options fix has covariance zero, or that of HeldCovariance;
/// in the latter case it propagates to what was estimated.
struct RigCovariance {
  Status status = Status::kOk;            ///< kDegenerate when the data leave something undetermined
  std::string message;                    ///< names the unknowns that the data cannot separate, and why
  std::vector<std::string> undetermined;  ///< one phrase per null direction
  std::vector<int> undetermined_lenses;   ///< cameras whose lenses are involved in them
  std::vector<Eigen::MatrixXd> params;    ///< per camera (P, P), units of Camera::params
  std::vector<Eigen::Matrix<double, 6, 6>> cam_from_world;  ///< per camera, left perturbation; zero for the one the gauge fixes
  Eigen::MatrixXd joint;  ///< (columns.total, columns.total)
  RigColumns columns;     ///< meaning of the rows of `joint`
};

/// sigma^2 (J^T W J)^-1 of the global unknowns. The boards' poses are eliminated by the Schur complement; the matrix is
/// scaled to unit diagonal and inverted by its eigenvalues. Eigenvalues below 1e-12 of the largest count as zero: such
/// directions are named, not inverted. Terms that the lens models omit are included by OmittedShift.
RigCovariance ComputeCovariance(const std::vector<View>& views, const RigState& state, const BundleOptions& options,
                                double sigma_px, const HeldCovariance& held = {});
RigCovariance ComputeCovariance(const std::vector<View>& views, const RigState& state, const Gauge& gauge, double sigma_px);

/// Normal equations of the global unknowns at `state` (both triangles), the boards' poses eliminated.
ReducedSystem ReducedEquations(const std::vector<View>& views, const RigState& state, const BundleOptions& options,
                               RigColumns* columns);

/// Cameras whose lenses are involved in the least determined direction, at any state.
std::vector<int> WeakestLenses(const std::vector<View>& views, const RigState& state, const BundleOptions& options);

/// Covariance of all cameras in the layout of geometry::Rig::joint_covariance. Cameras that share a lens share its errors.
Eigen::MatrixXd JointCovariance(const RigCovariance& covariance, const RigState& state);

/// (P + 6) square covariance of the lens parameters and the pose of one camera, in this order, with their correlation.
Eigen::MatrixXd CameraCovariance(const RigCovariance& covariance, const RigState& state, int camera_idx);

}  // namespace mvstudio::calib
