#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>

#include "geometry/lens/models/kannala4.h"
#include "geometry/lens/models/lens_base.h"
#include "geometry/lens/models/sphere.h"
#include "geometry/lens/models/spline_grid.h"

namespace mvstudio::geometry::internal {

/// mrcal's LENSMODEL_SPLINED_STEREOGRAPHIC: u = 2 (x, y) / (d + z), d = |(x, y, z)|, then (a', b') = u + du(u), see
/// spline_grid.h. The parameters are the control points of a grid, so their number is the grid's.
struct Splined : LensDefaults {
  static constexpr std::string_view kName = "splined";
  static constexpr std::array<LensParam, 0> kParams = {};
  static constexpr bool kWide = true;
  static constexpr bool kHasGrid = true;
  using Simpler = KannalaBrandt4;

  const SplineGrid& grid;

  explicit Splined(const SplineGrid& its_grid) : grid(its_grid) {}

  /// u with what its derivatives need.
  template <class T>
  struct StereographicPoint {
    Eigen::Matrix<T, 2, 1> u;
    T d, q;  ///< u = q (x, y)
  };
  /// False straight behind the camera, where there is none.
  template <class T>
  static bool Stereographic(const Eigen::Matrix<T, 3, 1>& x, StereographicPoint<T>* at) {
    using std::sqrt;
    const T s = x[0] * x[0] + x[1] * x[1];
    at->d = sqrt(s + x[2] * x[2]);
    const T denominator = SphereDenominator(T(1), T(1), s, x[2], at->d);
    if (!(denominator > T(0))) return false;
    at->q = T(2) / denominator;
    at->u << x[0] * at->q, x[1] * at->q;
    return true;
  }

  template <class T>
  bool Project(const T* k, const Eigen::Matrix<T, 3, 1>& x, T* a, T* b) const {
    StereographicPoint<T> at;
    if (!Stereographic(x, &at)) return false;
    const Eigen::Matrix<T, 2, 1> offset = SplineAt<false>(grid, k, at.u).offset;
    *a = at.u[0] + offset[0], *b = at.u[1] + offset[1];
    return true;
  }

  template <class Point, class Derivatives>
  bool ProjectWithDerivatives(const double* k, const Eigen::Vector3d& x, Point* point, Derivatives* derivatives) const {
    StereographicPoint<double> at;
    if (!Stereographic(x, &at)) return false;
    const SplineSample sample = SampleSpline(grid, k, at.u);
    point->a = at.u[0] + sample.offset[0], point->b = at.u[1] + sample.offset[1];
    if (!derivatives) return true;
    const double q = at.q, e = -0.5 * q * q / at.d;
    typename Point::ByX u_by_x;
    u_by_x << q + e * x[0] * x[0], e * x[0] * x[1], e * x[0] * (x[2] + at.d), e * x[0] * x[1], q + e * x[1] * x[1],
        e * x[1] * (x[2] + at.d);
    point->by_x = u_by_x + sample.d_offset_d_u * u_by_x;
    ByControlPoints(sample, derivatives);
    return true;
  }

 private:
  /// A plane point depends on (order + 1)^2 control points only.
  template <class Derivatives>
  void ByControlPoints(const SplineSample& sample, Derivatives* derivatives) const {
    int count = 4;
    for (int j = 0; j <= grid.order; ++j) {
      const int first = 4 + 2 * ((sample.row + j) * grid.cols + sample.col);
      for (int i = 0; i <= grid.order; ++i, count += 2) {
        const double weight = sample.weights_y[j] * sample.weights_x[i];
        derivatives->columns[count] = first + 2 * i, derivatives->columns[count + 1] = first + 2 * i + 1;
        derivatives->d_px.template middleCols<2>(count) << weight, 0, 0, weight;
      }
    }
    derivatives->count = count;
  }
};

}  // namespace mvstudio::geometry::internal
