#pragma once

#include <array>

#include "geometry/camera.h"

/// The radial functions of the lens models alone: r_d(r) = r L(r^2) for Brown and rational lenses with r = tan(theta), and
/// theta_d(theta) for kannala4. Internal to geometry/.
namespace mvstudio::geometry {

using Distortion = std::array<double, 8>;  // k1, k2, p1, p2, k3 … k6 with zeros; kannala4: k1 … k4

struct RadialValue {
  double value = 0;
  double slope = 0;
};

/// r_d and its derivative at `radius`. `model` is kPinhole, kBrown5, kRational8 or kKannalaBrandt4.
RadialValue EvaluateRadial(LensModel model, const Distortion& k, double radius);

/// The largest radius such that r_d is increasing and finite on [0, radius]: the first positive root of the derivative's
/// numerator or of the denominator. Infinity when there is none; at most pi for kannala4.
double FirstFold(LensModel model, const Distortion& k);

/// Solves r_d(r) = target for r in [0, fold], where r_d increases: Newton's method inside a shrinking bracket. Needs
/// 0 <= target <= r_d(fold).
double InvertRadial(LensModel model, const Distortion& k, double target, double fold);

}  // namespace mvstudio::geometry
