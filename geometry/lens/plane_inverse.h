#pragma once

#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "core/status.h"
#include "geometry/lens/camera.h"
#include "geometry/lens/models.h"

/// Inverses of the maps between image-plane coordinates. Internal to geometry/.
namespace mvstudio::geometry::internal {

/// A pixel to be reached, seen in the image plane.
struct PlaneTarget {
  PlaneTarget(const Camera& camera, const Eigen::Vector2d& px);

  Eigen::Vector2d ab;     // ((u - cx) / fx, (v - cy) / fy)
  Eigen::Vector2d px;     // u - cx, v - cy
  Eigen::Vector2d focal;  // fx, fy
  double limit_px = 0;    ///< 1e-9 px, or 8 roundings of numbers as large as the pixel's coordinates
};

struct PlaneValue {
  Eigen::Vector2d ab;
  Eigen::Matrix2d jacobian;
};

struct NewtonEnd {
  double residual_px = 0;
  double rounding_px = 0;  ///< what 4 roundings of the found place do to the pixel: near a pole they are more than the limit
  double determinant = 0;
};

/// Newton's method on f(at) = target.ab; every step is halved until the residual falls.
template <class Function>
NewtonEnd Newton(const Function& f, const PlaneTarget& target, Eigen::Vector2d* at) {
  const auto residual_of = [&](const PlaneValue& value) -> Eigen::Vector2d {
    return value.ab.cwiseProduct(target.focal) - target.px;
  };
  PlaneValue value = f(*at);
  Eigen::Vector2d residual = residual_of(value);
  for (int i = 0; i < 50 && residual.norm() > 0.01 * target.limit_px; ++i) {
    const Eigen::Vector2d step = value.jacobian.inverse() * residual.cwiseQuotient(target.focal);
    double damping = 1;
    Eigen::Vector2d next, next_residual;
    PlaneValue next_value;
    do {
      next = *at - damping * step;
      next_value = f(next);
      next_residual = residual_of(next_value);
      damping *= 0.5;
    } while (!(next_residual.norm() < residual.norm()) && damping > 1e-6);
    if (!(next_residual.norm() < residual.norm())) break;
    *at = next, value = next_value, residual = next_residual;
  }
  const double rounding = 4 * std::numeric_limits<double>::epsilon() * at->stableNorm() * value.jacobian.norm();
  return {residual.norm(), rounding * target.focal.maxCoeff(), value.jacobian.determinant()};
}

inline bool Solved(const NewtonEnd& end, const PlaneTarget& target) {
  return end.residual_px <= std::max(target.limit_px, end.rounding_px) && end.determinant >= 0;
}

/// The distortion of a perspective model.
template <class Lens>
PlaneValue DistortValue(const double* k, const Eigen::Vector2d& at) {
  PlaneValue value;
  Lens::Distort(k, at[0], at[1], &value.ab[0], &value.ab[1]);
  const PlaneSlopes<double> m = Lens::Slopes(k, at[0], at[1]);
  value.jacobian << m.a_by_a, m.a_by_b, m.b_by_a, m.b_by_b;
  return value;
}

/// Solves Lens::Distort(ab) = target by Newton's method, every step halved until the residual falls, from the start in `ab`;
/// where that fails, by continuation in the asymmetric terms, from the purely radial lens to the whole one. kOk: residual below
/// the limit, on the sheet of the image centre (Jacobian determinant >= 0). kOutsideValidRadius: stuck at a fold. `Lens` is
/// perspective.
template <class Lens>
Status InvertPlane(const double* k, const PlaneTarget& target, Eigen::Vector2d* ab) {
  constexpr int kContinuationSteps = 16;
  std::array<double, Lens::kParams.size()> now;
  std::copy(k, k + now.size(), now.begin());
  const auto solve = [&] {
    return Newton([&](const Eigen::Vector2d& at) { return DistortValue<Lens>(now.data(), at); }, target, ab);
  };
  const Eigen::Vector2d start = *ab;
  NewtonEnd end = solve();
  if (Solved(end, target)) return Status::kOk;
  *ab = start;
  for (int step = 0; step <= kContinuationSteps; ++step) {
    const double part = static_cast<double>(step) / kContinuationSteps;
    for (size_t i = 0; i < now.size(); ++i) now[i] = Lens::kParams[i].IsAsymmetric() ? part * k[i] : k[i];
    end = solve();
    if (!Solved(end, target)) break;
  }
  if (Solved(end, target)) return Status::kOk;
  // Newton's method with falling residuals can only stop where the determinant vanishes, or on the far side of a fold.
  return end.determinant < 1e-3 ? Status::kOutsideValidRadius : Status::kNotConverged;
}

/// Solves u + du(u) = target for u inside the control grid, where the determinant is positive: Newton from the target, then
/// from a search over the grid. kOutsideValidRadius when the border of the grid does not enclose the target.
Status InvertSplined(const SplineGrid& grid, const double* control, const PlaneTarget& target, Eigen::Vector2d* u);

}  // namespace mvstudio::geometry::internal
