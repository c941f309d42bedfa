#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "geometry/lens/models/lens_param.h"

namespace mvstudio::geometry {

/// Derivatives of a projection with respect to the few lens parameters that it depends on.
struct LensDerivatives {
  static constexpr int kMax = 36;  ///< splined: fx, fy, cx, cy and 16 control points of two numbers
  int count = 0;
  std::array<int, kMax> columns{};      ///< indices into Camera::params, ascending; 0 … count-1 for all models but splined
  Eigen::Matrix<double, 2, kMax> d_px;  ///< first `count` columns are valid
  Eigen::Matrix<double, 2, 3> d_px_d_x_in_cam;  ///< with respect to the point
};

namespace internal {

/// A radial function and its derivative.
struct RadialValue {
  double value = 0;
  double slope = 0;
};

/// Image-plane coordinates of a point and their derivatives by it.
struct PlanePoint {
  using Scalar = double;
  using ByX = Eigen::Matrix<double, 2, 3>;
  double a = 0, b = 0;
  ByX by_x;
};

/// Derivatives of distorted image-plane coordinates by the undistorted ones. T may be a vector of the compiler's, whose own
/// alignment depends on the instruction set.
template <class T>
struct alignas(sizeof(T)) PlaneSlopes {
  T a_by_a, a_by_b, b_by_a, b_by_b;
};

/// What models.h asks of every lens model, where most of them answer alike.
struct LensDefaults {
  using Simpler = void;
  static constexpr bool kWide = false;
  static constexpr bool kHasGrid = false;
  static constexpr bool kOpenCv = false;
  static constexpr bool kArithmetic = false;

  static double AxisScale(const double*) { return 1; }
  static std::vector<std::vector<double>> FitStarts() { return {}; }
  static std::vector<std::vector<double>> Basins() { return {}; }
};

/// Lenses with a radial function: tan(theta), for wide models theta in radians, to the distance from the centre on the image
/// plane. `Lens` has
///   Radial(k, r)   the function and its slope, asymmetric terms left out of account
///   FirstFold(k)   the largest radius such that the function is increasing and finite on [0, radius), or infinity
template <class Lens>
struct RadialLens : LensDefaults {
  /// Supremum of the radial function on [0, fold).
  static double LargestRadius(const double* k, double fold) { return std::isinf(fold) ? fold : Lens::Radial(k, fold).value; }

  /// Solves Radial(r) = target for r in [0, fold] by Newton's method inside a shrinking bracket. Needs target <= LargestRadius.
  static double InvertRadial(const double* k, double target, double fold) {
    if (target <= 0) return 0;
    double low = 0, high = std::isinf(fold) ? GrowBracket(k, target) : fold;
    double radius = std::min(target, 0.5 * (low + high));
    for (int i = 0; i < 200; ++i) {
      const RadialValue at = Lens::Radial(k, radius);
      // A value past a pole or an overflow is to the right of every target.
      (at.value < target ? low : high) = radius;
      const double newton = radius - (at.value - target) / at.slope;
      const double next = newton > low && newton < high ? newton : 0.5 * (low + high);
      if (at.value == target || next == radius || !(next > low && next < high)) return radius;
      radius = next;
    }
    return radius;
  }

 private:
  /// The upper end of a bracket for a radial function that never folds.
  static double GrowBracket(const double* k, double target) {
    double high = std::max(target, 1e-3);
    while (high < 1e150 && Lens::Radial(k, high).value < target) high *= 2;
    return high;
  }
};

}  // namespace internal
}  // namespace mvstudio::geometry
