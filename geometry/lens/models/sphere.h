#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/units.h"
#include "geometry/lens/models/lens_base.h"

namespace mvstudio::geometry::internal {

/// p d + q z with d = sqrt(side2 + z^2), without cancellation where the two terms nearly do (rays straight behind the camera).
template <class T>
T SphereDenominator(const T& p, const T& q, const T& side2, const T& z, const T& d) {
  if (!(p > T(0) && q * z < T(0))) return p * d + q * z;
  return (p * p * side2 + (p - q) * (p + q) * z * z) / (p * d - q * z);
}

/// sin(theta) / D(theta) with D = p d + q shifted, shifted = cos(theta) + shift, d = sqrt(beta sin^2 + shifted^2).
/// Derivative of D: p d' - q sin.
inline RadialValue SphereRadial(double p, double q, double beta, double shift, double theta) {
  const double half = std::cos(theta / 2), sine = 2 * half * std::sin(theta / 2), cosine = std::cos(theta);
  const double shifted = 2 * half * half + (shift - 1), side2 = beta * sine * sine;
  const double d = std::sqrt(side2 + shifted * shifted), slope_d = d > 0 ? sine * (beta * cosine - shifted) / d : 0;
  const double denominator = SphereDenominator(p, q, side2, shifted, d), value = sine / denominator;
  return {value, (cosine - value * (p * slope_d - q * sine)) / denominator};
}

/// The largest psi for which sin(psi) / (alpha + (1 - alpha) cos(psi)) is defined and increasing, as its cosine.
inline double SphereLimitCosine(double alpha) { return alpha > 0.5 ? (alpha - 1) / alpha : alpha / (alpha - 1); }

/// psi of r = sin(psi) / (a + b cos(psi)), on the increasing branch: with delta = atan(r b), sin(psi - delta) = r a cos(delta).
inline double InvertSphere(double a, double b, double r) {
  return std::atan(r * b) + std::atan2(r * a, std::sqrt(std::max(0.0, 1 + r * r * (b - a) * (b + a))));
}

/// Steps of a sphere lens's formula that its derivatives need again; the last two are doublesphere's.
template <class T>
struct SpherePoint {
  T side2, d, denominator, shifted, shifted_d;
};

/// Derivatives of the denominator D: by x and y they are `by_xy` times x and y.
struct DenominatorSlopes {
  double by_xy, by_z, by_k[2];
};

/// Wide lenses that look at a sphere from a place beside its centre: (a', b') = (x, y) / D, D > 0. `Lens` has
///   Denominator(k, x, &point)      fills in SpherePoint; false where D is undefined
///   Slopes(k, x, point)            the derivatives of D
///   InvertInClosedForm(k, target)  theta of a radius, but for rounding
template <class Lens>
struct Sphere : RadialLens<Lens> {
  static constexpr bool kWide = true;

  template <class T>
  static bool Project(const T* k, const Eigen::Matrix<T, 3, 1>& x, T* a, T* b) {
    SpherePoint<T> at;
    if (!Lens::Denominator(k, x, &at) || !(at.denominator > T(0))) return false;
    const T w = T(1) / at.denominator;
    *a = x[0] * w, *b = x[1] * w;
    return true;
  }

  template <class Point, class Derivatives>
  static bool ProjectWithDerivatives(const double* k, const Eigen::Vector3d& x, Point* point, Derivatives* derivatives) {
    SpherePoint<double> at;
    if (!Lens::Denominator(k, x, &at) || !(at.denominator > 0)) return false;
    const double w = 1 / at.denominator, a = x[0] * w, b = x[1] * w;
    point->a = a, point->b = b;
    if (!derivatives) return true;
    const DenominatorSlopes d = Lens::Slopes(k, x, at);
    const double ex = d.by_xy * x[0], ey = d.by_xy * x[1];
    point->by_x << w * (1 - a * ex), -w * a * ey, -w * a * d.by_z, -w * b * ex, w * (1 - b * ey), -w * b * d.by_z;
    constexpr int kCount = static_cast<int>(Lens::kParams.size());
    for (int i = 0; i < kCount; ++i) derivatives->d_px.col(4 + i) << -a * w * d.by_k[i], -b * w * d.by_k[i];
    return true;
  }

  /// The closed form, then Newton's method as long as it lowers the residual.
  static double InvertRadial(const double* k, double target, double fold) {
    if (target <= 0) return 0;
    double theta = std::clamp(Lens::InvertInClosedForm(k, target), 0.0, fold);
    RadialValue at = Lens::Radial(k, theta);
    for (int i = 0; i < 5 && at.value != target; ++i) {
      const double next = theta - (at.value - target) / at.slope;
      const RadialValue at_next = Lens::Radial(k, next);
      if (!(next >= 0 && next <= fold && std::abs(at_next.value - target) < std::abs(at.value - target))) break;
      theta = next, at = at_next;
    }
    return theta;
  }
};

}  // namespace mvstudio::geometry::internal
