#pragma once

#include <Eigen/Core>

#include "core/status.h"
#include "geometry/lens/camera.h"
#include "geometry/lens/radial.h"

/// Inverses of the maps between image-plane coordinates. Internal to geometry/.
namespace mvstudio::geometry {

/// A pixel to be reached, seen in the image plane.
struct PlaneTarget {
  PlaneTarget(const Camera& camera, const Eigen::Vector2d& px);

  Eigen::Vector2d ab;     // ((u - cx) / fx, (v - cy) / fy)
  Eigen::Vector2d px;     // u - cx, v - cy
  Eigen::Vector2d focal;  // fx, fy
  double limit_px = 0;    ///< 1e-9 px, or 8 roundings of numbers as large as the pixel's coordinates
};

/// Solves radial + decentring + prism (ab) = target by Newton's method, every step halved until the residual falls, from the
/// start in `ab`; where that fails, by continuation in the decentring and prism terms. kOk: residual below the limit, on the
/// sheet of the image centre (Jacobian determinant >= 0). kOutsideValidRadius: stuck at a fold. `family` is perspective.
Status InvertPlane(LensModel family, const LensTerms& terms, const PlaneTarget& target, Eigen::Vector2d* ab);

/// Solves u + du(u) = target for u inside the control grid, where the determinant is positive: Newton from the target, then
/// from a search over the grid. kOutsideValidRadius when the border of the grid does not enclose the target.
Status InvertSplined(const SplineGrid& grid, const double* control, const PlaneTarget& target, Eigen::Vector2d* u);

}  // namespace mvstudio::geometry
