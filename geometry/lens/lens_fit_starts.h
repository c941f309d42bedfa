// Private: the steps of FitLens.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "geometry/lens/camera.h"

namespace mvstudio::geometry {

/// Rays of a lens and their pixels.
struct RayBundle {
  std::vector<Eigen::Vector3d> rays;  // unit length, in cam
  std::vector<Eigen::Vector2d> px;
  double max_angle = 0;

  size_t size() const { return rays.size(); }
};
RayBundle RaysUpTo(const RayBundle& bundle, double angle);

/// Starts for the adjustment of a camera of model `to`, all with the pinhole `axis` on the optical axis.
std::vector<Camera> LensFitStarts(const Camera& axis, LensModel to, const RayBundle& bundle);

/// Control points that reproduce the bundle with the core of `axis`, by linear least squares; where there are no rays the
/// surface goes on without bending.
Camera FitSpline(const Camera& axis, const SplineGrid& grid, const RayBundle& bundle);

}  // namespace mvstudio::geometry
