#pragma once

#include "geometry/lens/models/decentred.h"
#include "geometry/lens/models/sphere.h"

namespace mvstudio::geometry::internal {

/// Unified model (C. Mei and P. Rives, ICRA 2007; OpenCV's omnidir): (a', b') = (x, y) / D,
///   D = z + xi d,   d = |(x, y, z)|.
struct Ucm : Sphere<Ucm> {
  static constexpr std::string_view kName = "ucm";
  static constexpr std::array<LensParam, 1> kParams = {LensParam("xi", 0.25).Above(-1)};

  template <class T>
  static bool Denominator(const T* k, const Eigen::Matrix<T, 3, 1>& x, SpherePoint<T>* at) {
    using std::sqrt;
    at->side2 = x[0] * x[0] + x[1] * x[1], at->d = sqrt(at->side2 + x[2] * x[2]);
    at->denominator = SphereDenominator(k[0], T(1), at->side2, x[2], at->d);
    return at->d > T(0);
  }
  static DenominatorSlopes Slopes(const double* k, const Eigen::Vector3d& x, const SpherePoint<double>& at) {
    const double e = k[0] / at.d;
    return {e, 1 + e * x[2], {at.d, 0}};
  }

  static RadialValue Radial(const double* k, double theta) { return SphereRadial(0, 1, 1, k[0], theta); }
  /// A fold for xi > 1, else a pole.
  static double FirstFold(const double* k) { return std::acos(k[0] > 1 ? -1 / k[0] : -k[0]); }
  static double LargestRadius(const double* k, double) {
    const double xi = k[0];
    return xi > 1 ? 1 / std::sqrt((xi - 1) * (xi + 1)) : std::numeric_limits<double>::infinity();
  }
  static double InvertInClosedForm(const double* k, double target) { return InvertSphere(k[0], 1, target); }

  static double AxisScale(const double* k) { return 1 + k[0]; }
  static std::vector<std::vector<double>> FitStarts() {
    return {{-0.5}, {-0.2}, {0.0}, {0.3}, {0.6}, {0.9}, {1.2}, {1.6}, {2.5}};
  }
};

/// OpenCV's omnidir with k1 = k2 = 0.
struct UcmP : Decentred<Ucm> {
  static constexpr std::string_view kName = "ucm_p";
};

}  // namespace mvstudio::geometry::internal
