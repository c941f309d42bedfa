#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "calib/bundle.h"
#include "core/status.h"
#include "geometry/rig.h"

namespace mvstudio::calib {

/// Covariance of a solved rig, boards marginalised.
struct RigCovariance {
  Status status = Status::kOk;            ///< kDegenerate when the data leave something undetermined
  std::string message;                    ///< names what is not determined
  std::vector<std::string> undetermined;  ///< "left: fx", … the parameters that dominate the null directions
  std::vector<Eigen::MatrixXd> params;    ///< per camera (P, P), units of Camera::params
  std::vector<Eigen::Matrix<double, 6, 6>> cam_from_world;  ///< per camera, left perturbation; zero for the one the gauge fixes
  Eigen::MatrixXd joint;  ///< of all free numbers: per camera its parameters, then its pose unless fixed
};

/// sigma^2 (J^T J)^-1 of the camera unknowns, by QR of the Jacobian frame by frame (the boards are eliminated by orthogonal
/// transformations, J^T J is never formed) and a singular value decomposition with unit columns. Singular values below 1e-9 of
/// the largest count as zero: rank-deficient problems are named instead of inverted.
RigCovariance ComputeCovariance(const std::vector<View>& views, const RigState& state, const Gauge& gauge, double sigma_px);

}  // namespace mvstudio::calib
