#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "core/units.h"

/// The surface du(u) of a splined stereographic lens: a tensor product of uniform B-splines (de Boor, "A practical guide to
/// splines"), laid out as mrcal does (mrcal.secretsauce.net, "lens models"). Outside the grid the border polynomials go on.
namespace mvstudio::geometry {

/// Control grid of a splined lens, in mrcal's terms: cols x rows control points at equal distances in the stereographic plane
/// u = 2 tan(theta / 2) (x, y) / |(x, y)|, centred on the axis; fov_x_deg is the horizontal field of view between the borders
/// where the spline still has all its control points (1 of them beyond for order 3, half a distance for order 2).
struct SplineGrid {
  int order = 3;      ///< degree of the B-spline, 2 or 3
  int cols = 0;       ///< mrcal's Nx, at least order + 1
  int rows = 0;       ///< mrcal's Ny, at least order + 1
  int fov_x_deg = 0;  ///< 1 … 359

  int NumControlParams() const { return 2 * cols * rows; }
  bool operator==(const SplineGrid& o) const {
    return order == o.order && cols == o.cols && rows == o.rows && fov_x_deg == o.fov_x_deg;
  }
};

/// Control points per unit of u.
inline double SegmentsPerU(const SplineGrid& grid) {
  const double edge_u = 2 * std::tan(DegToRad(grid.fov_x_deg) / 4);
  return (grid.cols - grid.order) / (2 * edge_u);
}

/// Half the width (x) or height (y) in u of the area where the spline has all its control points.
Eigen::Vector2d SplineHalfSize(const SplineGrid& grid);

/// First of the order + 1 control points, of `count`, that a coordinate depends on; `at` counts control points.
template <class T>
int SplineRunStart(int order, int count, const T& at) {
  int first = 0;
  while (first < count - order - 1 && at >= T(first + 0.5 * (order + 1))) ++first;
  return first;
}
inline int SplineRunStart(int order, int count, double at) {
  const double first = std::floor(at - 0.5 * (order - 1));
  return first > 0 ? static_cast<int>(std::min(first, static_cast<double>(count - order - 1))) : 0;
}

/// The order + 1 weights; x counts from the second control point of the run.
template <class T>
void SplineWeights(int order, const T& x, T* weights) {
  const T x2 = x * x;
  if (order == 2) {
    weights[0] = (T(0.5) - x) * (T(0.5) - x) / T(2);
    weights[1] = T(0.75) - x2;
    weights[2] = (T(0.5) + x) * (T(0.5) + x) / T(2);
  } else {
    const T y = T(1) - x, x3 = x2 * x;
    weights[0] = y * y * y / T(6);
    weights[1] = (T(3) * x3 - T(6) * x2 + T(4)) / T(6);
    weights[2] = (T(3) * (x + x2 - x3) + T(1)) / T(6);
    weights[3] = x3 / T(6);
  }
}
/// Their derivatives by x.
template <class T>
void SplineSlopes(int order, const T& x, T* slopes) {
  if (order == 2) {
    slopes[0] = x - T(0.5), slopes[1] = T(-2) * x, slopes[2] = x + T(0.5);
  } else {
    const T x2 = x * x;
    slopes[0] = T(-0.5) * (T(1) - x) * (T(1) - x), slopes[1] = T(1.5) * x2 - T(2) * x;
    slopes[2] = T(0.5) + x - T(1.5) * x2, slopes[3] = T(0.5) * x2;
  }
}

/// du at u, and what it was made of: du = sum_j weights_y[j] sum_i weights_x[i] control(row + j, col + i).
template <class T>
struct SplinePoint {
  Eigen::Matrix<T, 2, 1> offset = Eigen::Matrix<T, 2, 1>::Zero();
  Eigen::Matrix<T, 2, 2> d_offset_d_u = Eigen::Matrix<T, 2, 2>::Zero();  // filled in on demand
  int row = 0, col = 0;
  T weights_x[4], weights_y[4];
};

/// `control` are the parameters after fx, fy, cx, cy; kSlopes: with the derivatives by u.
template <bool kSlopes, class T>
SplinePoint<T> SplineAt(const SplineGrid& grid, const T* control, const Eigen::Matrix<T, 2, 1>& u) {
  using Vector2 = Eigen::Matrix<T, 2, 1>;
  const T scale(SegmentsPerU(grid));
  const T at_x = u[0] * scale + T(0.5 * (grid.cols - 1)), at_y = u[1] * scale + T(0.5 * (grid.rows - 1));
  SplinePoint<T> at;
  at.col = SplineRunStart(grid.order, grid.cols, at_x), at.row = SplineRunStart(grid.order, grid.rows, at_y);
  const T x = at_x - T(at.col + 1), y = at_y - T(at.row + 1);
  T slopes_x[4], slopes_y[4];
  SplineWeights(grid.order, x, at.weights_x), SplineWeights(grid.order, y, at.weights_y);
  if constexpr (kSlopes) SplineSlopes(grid.order, x, slopes_x), SplineSlopes(grid.order, y, slopes_y);
  for (int j = 0; j <= grid.order; ++j) {
    const T* point = control + 2 * ((at.row + j) * grid.cols + at.col);
    Vector2 value = Vector2::Zero(), slope = Vector2::Zero();
    for (int i = 0; i <= grid.order; ++i, point += 2) {
      const Vector2 c(point[0], point[1]);
      value += at.weights_x[i] * c;
      if constexpr (kSlopes) slope += slopes_x[i] * c;
    }
    at.offset += at.weights_y[j] * value;
    if constexpr (!kSlopes) continue;
    at.d_offset_d_u.col(0) += at.weights_y[j] * scale * slope;
    at.d_offset_d_u.col(1) += slopes_y[j] * scale * value;
  }
  return at;
}

/// Both in double, the program's.
using SplineSample = SplinePoint<double>;
SplineSample SampleSpline(const SplineGrid& grid, const double* control, const Eigen::Vector2d& u);
Eigen::Vector2d SplineOffset(const SplineGrid& grid, const double* control, const Eigen::Vector2d& u);

}  // namespace mvstudio::geometry
