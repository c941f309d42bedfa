#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "core/units.h"
#include "geometry/lens/camera.h"

/// The surface du(u) of a splined stereographic lens: a tensor product of uniform B-splines (de Boor, "A practical guide to
/// splines"), laid out as mrcal does (mrcal.secretsauce.net, "lens models"). Outside the grid the border polynomials go on.
namespace mvstudio::geometry {

/// Control points per unit of u.
inline double SegmentsPerU(const SplineGrid& grid) {
  const double edge_u = 2 * std::tan(DegToRad(grid.fov_x_deg) / 4);
  return (grid.cols - grid.order) / (2 * edge_u);
}

/// Half the width (x) or height (y) in u of the area where the spline has all its control points.
inline Eigen::Vector2d SplineHalfSize(const SplineGrid& grid) {
  return Eigen::Vector2d(grid.cols - grid.order, grid.rows - grid.order) / (2 * SegmentsPerU(grid));
}

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

/// du at u. `control` are the parameters after fx, fy, cx, cy.
template <class T>
Eigen::Matrix<T, 2, 1> SplineOffset(const SplineGrid& grid, const T* control, const Eigen::Matrix<T, 2, 1>& u) {
  const T scale(SegmentsPerU(grid));
  const T at_x = u[0] * scale + T(0.5 * (grid.cols - 1)), at_y = u[1] * scale + T(0.5 * (grid.rows - 1));
  const int col = SplineRunStart(grid.order, grid.cols, at_x), row = SplineRunStart(grid.order, grid.rows, at_y);
  T weights_x[4], weights_y[4];
  SplineWeights(grid.order, T(at_x - T(col + 1)), weights_x);
  SplineWeights(grid.order, T(at_y - T(row + 1)), weights_y);
  Eigen::Matrix<T, 2, 1> offset(T(0), T(0));
  for (int j = 0; j <= grid.order; ++j) {
    for (int i = 0; i <= grid.order; ++i) {
      const T weight = weights_y[j] * weights_x[i];
      const T* point = control + 2 * ((row + j) * grid.cols + col + i);
      offset[0] = offset[0] + weight * point[0];
      offset[1] = offset[1] + weight * point[1];
    }
  }
  return offset;
}

/// The same with what derivatives need: du = sum weights_y[j] weights_x[i] control(row + j, col + i).
struct SplineSample {
  Eigen::Vector2d offset = Eigen::Vector2d::Zero();
  Eigen::Matrix2d d_offset_d_u = Eigen::Matrix2d::Zero();
  int row = 0, col = 0;
  double weights_x[4], weights_y[4];
};
SplineSample SampleSpline(const SplineGrid& grid, const double* control, const Eigen::Vector2d& u);

}  // namespace mvstudio::geometry
