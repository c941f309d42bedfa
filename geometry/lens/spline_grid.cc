#include "geometry/lens/spline_grid.h"

namespace mvstudio::geometry {
namespace {

void SplineSlopes(int order, double x, double* slopes) {
  if (order == 2) {
    slopes[0] = x - 0.5, slopes[1] = -2 * x, slopes[2] = x + 0.5;
  } else {
    const double x2 = x * x;
    slopes[0] = -0.5 * (1 - x) * (1 - x), slopes[1] = 1.5 * x2 - 2 * x, slopes[2] = 0.5 + x - 1.5 * x2, slopes[3] = 0.5 * x2;
  }
}

}  // namespace

SplineSample SampleSpline(const SplineGrid& grid, const double* control, const Eigen::Vector2d& u) {
  const double scale = SegmentsPerU(grid);
  const double at_x = u[0] * scale + 0.5 * (grid.cols - 1), at_y = u[1] * scale + 0.5 * (grid.rows - 1);
  SplineSample sample;
  sample.col = SplineRunStart(grid.order, grid.cols, at_x), sample.row = SplineRunStart(grid.order, grid.rows, at_y);
  const double x = at_x - (sample.col + 1), y = at_y - (sample.row + 1);
  double slopes_x[4], slopes_y[4];
  SplineWeights(grid.order, x, sample.weights_x);
  SplineWeights(grid.order, y, sample.weights_y);
  SplineSlopes(grid.order, x, slopes_x);
  SplineSlopes(grid.order, y, slopes_y);
  for (int j = 0; j <= grid.order; ++j) {
    const double* point = control + 2 * ((sample.row + j) * grid.cols + sample.col);
    Eigen::Vector2d value = Eigen::Vector2d::Zero(), slope = Eigen::Vector2d::Zero();
    for (int i = 0; i <= grid.order; ++i, point += 2) {
      const Eigen::Vector2d c(point[0], point[1]);
      value += sample.weights_x[i] * c;
      slope += slopes_x[i] * c;
    }
    sample.offset += sample.weights_y[j] * value;
    sample.d_offset_d_u.col(0) += sample.weights_y[j] * scale * slope;
    sample.d_offset_d_u.col(1) += slopes_y[j] * scale * value;
  }
  return sample;
}

}  // namespace mvstudio::geometry
