#pragma once

#include <Eigen/Core>

#include "geometry/lens/models/lens_base.h"

namespace mvstudio::geometry::internal {

/// Lenses that see what lies before them: (a', b') is a function of a = x / z, b = y / z, z > 0. `Lens` has
///   Distort(k, a, b, &a_out, &b_out)  that function, for numbers of any kind T and parameters of T's elements
///   Slopes(k, a, b)                   its derivatives by a and b
///   ByParams(k, a, b, &derivatives)   those by the parameters, into the columns 4 … of LensDerivatives::d_px
template <class Lens>
struct Perspective : RadialLens<Lens> {
  static constexpr bool kArithmetic = true;

  template <class T>
  static bool Project(const T* k, const Eigen::Matrix<T, 3, 1>& x, T* a, T* b) {
    if (!(x[2] > T(0))) return false;
    Lens::Distort(k, T(x[0] / x[2]), T(x[1] / x[2]), a, b);
    return true;
  }

  template <class Point, class Derivatives>
  static bool ProjectWithDerivatives(const double* k, const Eigen::Vector3d& x, Point* point, Derivatives* derivatives) {
    double distorted_a, distorted_b;
    if (!Project(k, x, &distorted_a, &distorted_b)) return false;
    // Nothing is written until all is known: the compiler could not tell that `k` stays, and would begin anew.
    if (derivatives) {
      const double w = 1 / x[2], a = x[0] / x[2], b = x[1] / x[2];
      const PlaneSlopes<double> m = Lens::Slopes(k, a, b);
      Lens::ByParams(k, a, b, derivatives);
      point->by_x << m.a_by_a * w, m.a_by_b * w, -(m.a_by_a * a + m.a_by_b * b) * w, m.b_by_a * w, m.b_by_b * w,
          -(m.b_by_a * a + m.b_by_b * b) * w;
    }
    point->a = distorted_a, point->b = distorted_b;
    return true;
  }
};

}  // namespace mvstudio::geometry::internal
