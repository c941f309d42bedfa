#include "geometry/lens/plane_inverse.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "core/units.h"
#include "geometry/lens/models/spline_grid.h"

namespace mvstudio::geometry::internal {
namespace {

constexpr double kMaxResidualPx = 1e-9;
constexpr int kSamplesPerSegment = 4;
constexpr int kMaxStarts = 8;

PlaneValue Spline(const SplineGrid& grid, const double* control, const Eigen::Vector2d& u) {
  const SplineSample sample = SampleSpline(grid, control, u);
  return {u + sample.offset, Eigen::Matrix2d::Identity() + sample.d_offset_d_u};
}

/// Starts for Newton's method: places of a regular grid whose images lie nearest to the target, nearest first.
std::vector<Eigen::Vector2d> SplineStarts(const SplineGrid& grid, const double* control, const PlaneTarget& target) {
  const Eigen::Vector2d half = SplineHalfSize(grid);
  const int nx = kSamplesPerSegment * (grid.cols - grid.order), ny = kSamplesPerSegment * (grid.rows - grid.order);
  std::vector<std::pair<double, Eigen::Vector2d>> places;
  for (int j = 0; j <= ny; ++j) {
    for (int i = 0; i <= nx; ++i) {
      const Eigen::Vector2d u(half[0] * (2.0 * i / nx - 1), half[1] * (2.0 * j / ny - 1));
      places.emplace_back((u + SplineOffset(grid, control, u) - target.ab).squaredNorm(), u);
    }
  }
  const size_t count = std::min<size_t>(kMaxStarts, places.size());
  std::partial_sort(places.begin(), places.begin() + count, places.end(),
                    [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<Eigen::Vector2d> starts;
  for (size_t i = 0; i < count; ++i) starts.push_back(places[i].second);
  return starts;
}

/// How often the image of the grid's border runs round the target.
int BorderWinding(const SplineGrid& grid, const double* control, const PlaneTarget& target) {
  const Eigen::Vector2d half = SplineHalfSize(grid);
  const Eigen::Vector2d corners[5] = {
      {-half[0], -half[1]}, {half[0], -half[1]}, {half[0], half[1]}, {-half[0], half[1]}, {-half[0], -half[1]}};
  double angle = 0;
  Eigen::Vector2d last = corners[0] + SplineOffset(grid, control, corners[0]) - target.ab;
  for (int side = 0; side < 4; ++side) {
    const int count = 8 * kSamplesPerSegment * std::max(grid.cols, grid.rows);
    for (int i = 1; i <= count; ++i) {
      const Eigen::Vector2d u = corners[side] + (corners[side + 1] - corners[side]) * i / count;
      const Eigen::Vector2d now = u + SplineOffset(grid, control, u) - target.ab;
      angle += std::atan2(last[0] * now[1] - last[1] * now[0], last.dot(now));
      last = now;
    }
  }
  return static_cast<int>(std::lround(angle / (2 * kPi)));
}

}  // namespace

PlaneTarget::PlaneTarget(const Camera& camera, const Eigen::Vector2d& pixel)
    : ab((pixel[0] - camera.cx()) / camera.fx(), (pixel[1] - camera.cy()) / camera.fy()),
      px(pixel[0] - camera.cx(), pixel[1] - camera.cy()),
      focal(camera.fx(), camera.fy()) {
  const double size = pixel.lpNorm<Eigen::Infinity>() + std::max(std::abs(camera.cx()), std::abs(camera.cy()));
  limit_px = std::max(kMaxResidualPx, 8 * std::numeric_limits<double>::epsilon() * size);
}

Status InvertSplined(const SplineGrid& grid, const double* control, const PlaneTarget& target, Eigen::Vector2d* u) {
  const Eigen::Vector2d half = SplineHalfSize(grid);
  const auto f = [&](const Eigen::Vector2d& at) { return Spline(grid, control, at); };
  const auto solve_from = [&](const Eigen::Vector2d& start) {
    *u = start;
    const NewtonEnd end = Newton(f, target, u);
    return Solved(end, target) && (u->array().abs() <= half.array()).all();
  };
  if (solve_from(target.ab.cwiseMax(-half).cwiseMin(half))) return Status::kOk;
  for (const Eigen::Vector2d& start : SplineStarts(grid, control, target)) {
    if (solve_from(start)) return Status::kOk;
  }
  return BorderWinding(grid, control, target) == 0 ? Status::kOutsideValidRadius : Status::kNotConverged;
}

}  // namespace mvstudio::geometry::internal
