#pragma once

#include "geometry/lens/models/decentred.h"
#include "geometry/lens/models/sphere.h"
#include "geometry/lens/models/ucm.h"

namespace mvstudio::geometry::internal {

/// Double sphere (V. Usenko, N. Demmel, D. Cremers, 3DV 2018): (a', b') = (x, y) / D,
///   D = alpha |(x, y, w)| + (1 - alpha) w,   w = z + xi d,   d = |(x, y, z)|.
struct DoubleSphere : Sphere<DoubleSphere> {
  static constexpr std::string_view kName = "doublesphere";
  static constexpr std::array<LensParam, 2> kParams = {LensParam("xi", 0.25).Above(-1),
                                                       LensParam("alpha", 0.4).StartsAt(0.5).Within(0, 1)};
  using Simpler = Ucm;

  template <class T>
  static bool Denominator(const T* k, const Eigen::Matrix<T, 3, 1>& x, SpherePoint<T>* at) {
    using std::sqrt;
    at->side2 = x[0] * x[0] + x[1] * x[1], at->d = sqrt(at->side2 + x[2] * x[2]);
    at->shifted = x[2] + k[0] * at->d, at->shifted_d = sqrt(at->side2 + at->shifted * at->shifted);
    if (!(at->d > T(0) && at->shifted_d > T(0))) return false;
    at->denominator = SphereDenominator(k[1], T(T(1) - k[1]), at->side2, at->shifted, at->shifted_d);
    return true;
  }
  static DenominatorSlopes Slopes(const double* k, const Eigen::Vector3d& x, const SpherePoint<double>& at) {
    const double by_shifted = k[1] * at.shifted / at.shifted_d + 1 - k[1], e = k[0] / at.d;
    return {k[1] / at.shifted_d + by_shifted * e, by_shifted * (1 + e * x[2]), {by_shifted * at.d, at.shifted_d - at.shifted}};
  }

  static RadialValue Radial(const double* k, double theta) { return SphereRadial(k[1], 1 - k[1], 1, k[0], theta); }
  static double FirstFold(const double* k) {
    const double xi = k[0], cosine = SphereLimitCosine(k[1]), sine = std::sqrt(1 - cosine * cosine);
    // Seen from the second centre, xi behind the first, the point on the sphere is at phi: sin(theta - phi) = xi sin(phi).
    if (xi >= 1 && (cosine < 0 || xi * sine > 1)) return std::acos(-1 / xi);
    return std::min(kPi, std::atan2(sine, cosine) + std::asin(std::clamp(xi * sine, -1.0, 1.0)));
  }
  /// Either the second sphere's shadow ends (phi at its limit) or the first one's does (xi >= 1).
  static double LargestRadius(const double* k, double fold) {
    const double at_fold = Radial(k, fold).value;
    const bool first_ends = k[0] >= 1 && fold == std::acos(-1 / k[0]);
    return first_ends ? at_fold : k[1] > 0.5 ? 1 / std::sqrt(2 * k[1] - 1) : std::numeric_limits<double>::infinity();
  }
  static double InvertInClosedForm(const double* k, double target) {
    const double phi = InvertSphere(k[1], 1 - k[1], target);
    return phi + std::asin(std::clamp(k[0] * std::sin(phi), -1.0, 1.0));
  }

  static double AxisScale(const double* k) { return 1 + k[0]; }
  static std::vector<std::vector<double>> FitStarts() {
    std::vector<std::vector<double>> starts;
    for (const double xi : {-0.4, -0.2, 0.0, 0.3, 0.8}) {
      for (const double alpha : {0.05, 0.3, 0.5, 0.6, 0.75}) starts.push_back({xi, alpha});
    }
    return starts;
  }
  static std::vector<std::vector<double>> Basins() { return {{-0.2, 0.5}, {0.3, 0.5}}; }
};

struct DoubleSphereP : Decentred<DoubleSphere> {
  static constexpr std::string_view kName = "doublesphere_p";
};

}  // namespace mvstudio::geometry::internal
