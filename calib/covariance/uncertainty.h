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

/// Covariance of a solved rig, boards marginalised. What the options fix has covariance zero, or the one that HeldCovariance gives
/// it; then what was estimated holds the part that comes from it.
struct RigCovariance {
  Status status = Status::kOk;            ///< kDegenerate when the data leave something undetermined
  std::string message;                    ///< says what cannot be told apart and why
  std::vector<std::string> undetermined;  ///< one phrase for every null direction
  std::vector<int> undetermined_lenses;   ///< cameras whose lenses take part in them
  std::vector<Eigen::MatrixXd> params;    ///< per camera (P, P), units of Camera::params
  std::vector<Eigen::Matrix<double, 6, 6>> cam_from_world;  ///< per camera, left perturbation; zero for the one the gauge fixes
  Eigen::MatrixXd joint;  ///< (columns.total, columns.total)
  RigColumns columns;     ///< what the rows of `joint` are
};

/// sigma^2 (J^T W J)^-1 of the global unknowns, the boards' poses eliminated by the Schur complement, inverted by the
/// eigenvalues of the matrix with unit diagonal. Eigenvalues below 1e-12 of the largest count as zero: what is not determined is
/// named by its direction instead of inverted. Terms that lenses were spared count with OmittedShift.
RigCovariance ComputeCovariance(const std::vector<View>& views, const RigState& state, const BundleOptions& options,
                                double sigma_px, const HeldCovariance& held = {});
RigCovariance ComputeCovariance(const std::vector<View>& views, const RigState& state, const Gauge& gauge, double sigma_px);

/// Cameras whose lenses take part in what the data determine least, at any state.
std::vector<int> WeakestLenses(const std::vector<View>& views, const RigState& state, const BundleOptions& options);

/// Covariance of all cameras in the layout of geometry::Rig::joint_covariance. Cameras that share a lens share its errors.
Eigen::MatrixXd JointCovariance(const RigCovariance& covariance, const RigState& state);

/// (P + 6) square covariance of the lens parameters and the pose of one camera, in this order, with their correlation.
Eigen::MatrixXd CameraCovariance(const RigCovariance& covariance, const RigState& state, int camera_idx);

}  // namespace mvstudio::calib
