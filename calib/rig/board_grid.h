#pragma once

#include <Eigen/Core>
#include <cmath>
#include <limits>
#include <vector>

#include "calib/bundle/view.h"
#include "core/units.h"
#include "geometry/rigid/rigid3.h"

/// Places of a board whose corners may be numbered in several ways.
namespace mvstudio::calib::internal {

/// A renumbering counts when it brings boards this many times nearer, and to less than this part of their size.
constexpr double kClear = 4, kMaxMended = 0.1;

/// Extent of the board's corners and the step between neighbours.
struct Grid {
  Eigen::Vector2d low, high;
  double step = 0;
};

inline Grid NoGrid() {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  return {Eigen::Vector2d::Constant(kInfinity), Eigen::Vector2d::Constant(-kInfinity), kInfinity};
}

inline void Widen(const Eigen::Matrix3Xd& x_in_board, Grid* grid) {
  const Eigen::Matrix2Xd xy = x_in_board.topRows<2>();
  grid->low = grid->low.cwiseMin(xy.rowwise().minCoeff()), grid->high = grid->high.cwiseMax(xy.rowwise().maxCoeff());
  for (Eigen::Index i = 0; i + 1 < xy.cols(); ++i) grid->step = std::min(grid->step, (xy.col(i + 1) - xy.col(i)).norm());
}

inline Grid GridOf(const std::vector<View>& views) {
  Grid grid = NoGrid();
  for (const View& view : views) Widen(view.x_in_board, &grid);
  return grid;
}

/// By `quarters` quarter turns about the middle of a board whose least and greatest coordinates sum up to `ends`.
inline geometry::Rigid3 Turn(const Eigen::Vector2d& ends, int quarters) {
  const Eigen::Vector3d middle(ends.x() / 2, ends.y() / 2, 0);
  geometry::Rigid3 turn;
  turn.rotation = geometry::RotationExp(Eigen::Vector3d(0, 0, quarters * kPi / 2));
  turn.translation = middle - turn.rotation * middle;
  return turn;
}

/// How far two places of the board lie apart, rms over its four outer corners, in its diagonals.
inline double Apart(const geometry::Rigid3& a, const geometry::Rigid3& b, const Grid& grid) {
  double sum = 0;
  for (const double x : {grid.low.x(), grid.high.x()}) {
    for (const double y : {grid.low.y(), grid.high.y()})
      sum += (a * Eigen::Vector3d(x, y, 0) - b * Eigen::Vector3d(x, y, 0)).squaredNorm();
  }
  return std::sqrt(sum / 4) / (grid.high - grid.low).norm();
}

}  // namespace mvstudio::calib::internal
