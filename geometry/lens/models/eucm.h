#pragma once

#include "geometry/lens/models/decentred.h"
#include "geometry/lens/models/sphere.h"
#include "geometry/lens/models/ucm.h"

namespace mvstudio::geometry::internal {

/// Extended unified model (B. Khomutenko, G. Garcia, P. Martinet, RA-L 2016): (a', b') = (x, y) / D,
///   D = alpha sqrt(beta (x^2 + y^2) + z^2) + (1 - alpha) z.
struct Eucm : Sphere<Eucm> {
  static constexpr std::string_view kName = "eucm";
  static constexpr std::array<LensParam, 2> kParams = {LensParam("alpha", 0.4).StartsAt(0.5).Within(0, 1),
                                                       LensParam("beta", 1.1).StartsAt(1).Above(0)};
  using Simpler = Ucm;

  template <class T>
  static bool Denominator(const T* k, const Eigen::Matrix<T, 3, 1>& x, SpherePoint<T>* at) {
    using std::sqrt;
    at->side2 = x[0] * x[0] + x[1] * x[1];
    const T d2 = k[1] * at->side2 + x[2] * x[2];
    if (!(d2 > T(0))) return false;
    at->d = sqrt(d2);
    at->denominator = SphereDenominator(k[0], T(T(1) - k[0]), T(k[1] * at->side2), x[2], at->d);
    return true;
  }
  static DenominatorSlopes Slopes(const double* k, const Eigen::Vector3d& x, const SpherePoint<double>& at) {
    const double e = k[0] / at.d;
    return {e * k[1], e * x[2] + 1 - k[0], {at.d - x[2], 0.5 * e * at.side2}};
  }

  static RadialValue Radial(const double* k, double theta) { return SphereRadial(k[0], 1 - k[0], k[1], 0, theta); }
  static double FirstFold(const double* k) {
    const double cosine = SphereLimitCosine(k[0]), sine = std::sqrt(1 - cosine * cosine);
    return std::atan2(sine, cosine * std::sqrt(k[1]));
  }
  static double LargestRadius(const double* k, double) {
    return k[0] > 0.5 ? 1 / std::sqrt(k[1] * (2 * k[0] - 1)) : std::numeric_limits<double>::infinity();
  }
  static double InvertInClosedForm(const double* k, double target) {
    const double root = std::sqrt(k[1]), psi = InvertSphere(k[0], 1 - k[0], target * root);
    return std::atan2(std::sin(psi), std::cos(psi) * root);
  }

  static std::vector<std::vector<double>> FitStarts() {
    std::vector<std::vector<double>> starts;
    for (const double alpha : {0.05, 0.3, 0.5, 0.6, 0.75}) {
      for (const double beta : {0.4, 0.7, 1.0, 1.5, 2.5}) starts.push_back({alpha, beta});
    }
    return starts;
  }
};

struct EucmP : Decentred<Eucm> {
  static constexpr std::string_view kName = "eucm_p";
};

}  // namespace mvstudio::geometry::internal
