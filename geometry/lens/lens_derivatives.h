#pragma once

#include <Eigen/Core>
#include <array>

#include "geometry/lens/camera.h"

namespace mvstudio::geometry {

/// Derivatives of a projection with respect to the few lens parameters that it depends on.
struct LensDerivatives {
  static constexpr int kMax = 36;  ///< splined: fx, fy, cx, cy and 16 control points of two numbers
  int count = 0;
  std::array<int, kMax> columns{};      ///< indices into Camera::params, ascending; 0 … count-1 for all models but splined
  Eigen::Matrix<double, 2, kMax> d_px;  ///< first `count` columns are valid
  Eigen::Matrix<double, 2, 3> d_px_d_x_in_cam;  ///< with respect to the point
};

/// Projection by the lens's formula alone, without the valid radius (optimisers may pass through regions that Projector
/// refuses). False where the formula is undefined or the pixel is not finite. `derivatives` may be null.
bool ProjectLens(const Camera& camera, const Eigen::Vector3d& x_in_cam, Eigen::Vector2d* px, LensDerivatives* derivatives);

}  // namespace mvstudio::geometry
