#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/status.h"
#include "triangulate/point/prepared_rig.h"

namespace mvstudio::triangulate {

struct Refinement {
  Status status = Status::kOk;  ///< kBehindCamera, kOutsideValidRadius, kDegenerate, kNotConverged
  Eigen::Vector3d x_in_local = Eigen::Vector3d::Zero();
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();  ///< 1/m^2: J^T J of the whitened residuals at the end
  double chi_squared = 0;                                 ///< sum |r|^2 / sigma^2
  double worst_sigmas = 0;                                ///< largest |r| / sigma
};

/// Maximum-likelihood point for Gaussian pixel noise: Levenberg-Marquardt on the residuals (projected minus observed, px)
/// through the full lens, each divided by its sigma. A step that leaves the cameras' valid region is rejected, never counted
/// as a zero residual.
Refinement Refine(const std::vector<View>& views, const Eigen::Vector3d& start_in_local, int max_iterations = 50);

/// The same quantities at a given point, without moving it.
Refinement Evaluate(const std::vector<View>& views, const Eigen::Vector3d& x_in_local);

/// |r| / sigma of one view at a point; infinity where the camera cannot see it.
double WhitenedResidual(const View& view, const Eigen::Vector3d& x_in_local);

/// The view's residual over sigma to first order, without the lens: W (x - c) / (ray . (x - c)) for a point x near the ray
/// from the centre c. W (2 x 3) holds the derivatives of the pixel with respect to the ray's unit direction, in local;
/// zero where the lens has none.
Eigen::Matrix<double, 2, 3> WhitenedRows(const View& view);

}  // namespace mvstudio::triangulate
