#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>

#include "core/units.h"
#include "geometry/lens/models/decentred.h"
#include "geometry/lens/models/lens_base.h"
#include "geometry/lens/models/polynomial.h"
#include "geometry/lens/models/ucm.h"

namespace mvstudio::geometry::internal {

/// J. Kannala and S. Brandt, PAMI 2006, radial part: with theta = atan2(|(x, y)|, z)
///   (a', b') = theta_d (x, y) / |(x, y)|,   theta_d = theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8).
struct KannalaBrandt4 : RadialLens<KannalaBrandt4> {
  static constexpr std::string_view kName = "kannala4";
  static constexpr std::array<LensParam, 4> kParams = {
      LensParam{LensRole::kNumerator, 0, "k1", -0.020}, LensParam{LensRole::kNumerator, 0, "k2", 0.010},
      LensParam{LensRole::kNumerator, 0, "k3", -0.003}, LensParam{LensRole::kNumerator, 0, "k4", 0.0005}};
  static constexpr bool kWide = true;
  using Simpler = Ucm;

  template <class T>
  static bool Project(const T* k, const Eigen::Matrix<T, 3, 1>& x, T* a, T* b) {
    Polar<T> at;
    if (!PolarOf(k, x, &at)) return false;
    *a = at.cosine * at.radius, *b = at.sine * at.radius;
    return true;
  }

  template <class Point, class Derivatives>
  static bool ProjectWithDerivatives(const double* k, const Eigen::Vector3d& x, Point* point, Derivatives* derivatives) {
    Polar<double> at;
    if (!PolarOf(k, x, &at)) return false;
    const double c = at.cosine, d = at.sine;
    point->a = c * at.radius, point->b = d * at.radius;
    if (!derivatives) return true;
    if (!(at.side2 > 0)) {
      const double w = 1 / x[2];
      point->by_x << w, 0, 0, 0, w, 0;
      derivatives->d_px.template middleCols<4>(4).setZero();
      return true;
    }
    const double t2 = at.theta * at.theta, slope = 1 + t2 * (3 * k[0] + t2 * (5 * k[1] + t2 * (7 * k[2] + t2 * 9 * k[3])));
    const double by_theta = slope / (at.side2 + x[2] * x[2]), across = at.radius * at.inverse_side;
    const double rest = by_theta * x[2] - across;
    point->by_x << across + rest * c * c, rest * c * d, -c * by_theta * at.side, rest * c * d, across + rest * d * d,
        -d * by_theta * at.side;
    double power = at.theta * t2;
    for (int i = 4; i < 8; ++i, power *= t2) derivatives->d_px.col(i) << c * power, d * power;
    return true;
  }

  static RadialValue Radial(const double* k, double theta) {
    const double s = theta * theta;
    return {RadiusAt(k, theta), 1 + s * (3 * k[0] + s * (5 * k[1] + s * (7 * k[2] + s * 9 * k[3])))};
  }

  /// At most pi.
  static double FirstFold(const double* k) {
    return std::min(kPi, RootBelow(FirstPositiveRoot({1, 3 * k[0], 5 * k[1], 7 * k[2], 9 * k[3]})));
  }

 private:
  /// (a', b') = radius (cosine, sine).
  template <class T>
  struct Polar {
    T side2, side, inverse_side, theta, cosine, sine, radius;
  };

  template <class T>
  static T RadiusAt(const T* k, const T& theta) {
    const T t2 = theta * theta;
    return theta * (T(1) + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3]))));
  }

  template <class T>
  static bool PolarOf(const T* k, const Eigen::Matrix<T, 3, 1>& x, Polar<T>* at) {
    using std::atan2;
    using std::sqrt;
    at->side2 = x[0] * x[0] + x[1] * x[1];
    if (!(at->side2 > T(0))) {
      if (!(x[2] > T(0))) return false;
      at->cosine = x[0], at->sine = x[1], at->radius = T(1) / x[2];  // the limit on the axis
      at->side = at->inverse_side = at->theta = T(0);
      return true;
    }
    at->side = sqrt(at->side2), at->inverse_side = T(1) / at->side, at->theta = atan2(at->side, x[2]);
    at->cosine = x[0] * at->inverse_side, at->sine = x[1] * at->inverse_side;
    at->radius = RadiusAt(k, at->theta);
    return true;
  }
};

struct KannalaBrandt4P : Decentred<KannalaBrandt4> {
  static constexpr std::string_view kName = "kannala4_p";
};

}  // namespace mvstudio::geometry::internal
