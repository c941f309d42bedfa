#include "geometry/lens/models/spline_grid.h"

namespace mvstudio::geometry {

Eigen::Vector2d SplineHalfSize(const SplineGrid& grid) {
  return Eigen::Vector2d(grid.cols - grid.order, grid.rows - grid.order) / (2 * SegmentsPerU(grid));
}

SplineSample SampleSpline(const SplineGrid& grid, const double* control, const Eigen::Vector2d& u) {
  return SplineAt<true>(grid, control, u);
}

Eigen::Vector2d SplineOffset(const SplineGrid& grid, const double* control, const Eigen::Vector2d& u) {
  return SplineAt<false>(grid, control, u).offset;
}

}  // namespace mvstudio::geometry
