#include "geometry/lens/plane_inverse.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "core/units.h"
#include "geometry/lens/plane_distortion.h"
#include "geometry/lens/spline_grid.h"

namespace mvstudio::geometry {
namespace {

constexpr double kMaxResidualPx = 1e-9;
constexpr int kContinuationSteps = 16;
constexpr int kSamplesPerSegment = 4;
constexpr int kMaxStarts = 8;

struct PlaneValue {
  Eigen::Vector2d ab;
  Eigen::Matrix2d jacobian;
};

/// Radial, decentring and prism terms of a perspective family.
PlaneValue Distort(LensModel family, const LensTerms& terms, const Eigen::Vector2d& at) {
  const auto m = family == LensModel::kPinhole     ? DistortPlane<PlaneTerms::kDecentring>(terms, at[0], at[1])
                 : family == LensModel::kRational8 ? DistortPlane<PlaneTerms::kAll>(terms, at[0], at[1])
                                                   : DistortPlane<PlaneTerms::kPolynomial>(terms, at[0], at[1]);
  PlaneValue value;
  value.ab << m.a, m.b;
  value.jacobian << m.a_by_a, m.a_by_b, m.b_by_a, m.b_by_b;
  return value;
}

struct NewtonEnd {
  double residual_px = 0;
  double rounding_px = 0;  ///< what 4 roundings of the found place do to the pixel: near a pole they are more than the limit
  double determinant = 0;
};

/// Newton's method on f(at) = target.ab; every step is halved until the residual falls.
template <class Function>
NewtonEnd Newton(const Function& f, const PlaneTarget& target, Eigen::Vector2d* at) {
  const auto residual_of = [&](const PlaneValue& value) -> Eigen::Vector2d {
    return value.ab.cwiseProduct(target.focal) - target.px;
  };
  PlaneValue value = f(*at);
  Eigen::Vector2d residual = residual_of(value);
  for (int i = 0; i < 50 && residual.norm() > 0.01 * target.limit_px; ++i) {
    const Eigen::Vector2d step = value.jacobian.inverse() * residual.cwiseQuotient(target.focal);
    double damping = 1;
    Eigen::Vector2d next, next_residual;
    PlaneValue next_value;
    do {
      next = *at - damping * step;
      next_value = f(next);
      next_residual = residual_of(next_value);
      damping *= 0.5;
    } while (!(next_residual.norm() < residual.norm()) && damping > 1e-6);
    if (!(next_residual.norm() < residual.norm())) break;
    *at = next, value = next_value, residual = next_residual;
  }
  const double rounding = 4 * std::numeric_limits<double>::epsilon() * at->stableNorm() * value.jacobian.norm();
  return {residual.norm(), rounding * target.focal.maxCoeff(), value.jacobian.determinant()};
}

bool Solved(const NewtonEnd& end, const PlaneTarget& target) {
  return end.residual_px <= std::max(target.limit_px, end.rounding_px) && end.determinant >= 0;
}

/// Follows the root from the purely radial lens to the whole one.
NewtonEnd Continue(LensModel family, const LensTerms& terms, const PlaneTarget& target, Eigen::Vector2d* ab) {
  NewtonEnd end;
  for (int i = 0; i <= kContinuationSteps; ++i) {
    const double part = static_cast<double>(i) / kContinuationSteps;
    LensTerms partial = terms;
    partial.p1 *= part, partial.p2 *= part;
    for (double& s : partial.prism) s *= part;
    end = Newton([&](const Eigen::Vector2d& at) { return Distort(family, partial, at); }, target, ab);
    if (!Solved(end, target)) break;
  }
  return end;
}

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
      places.emplace_back((u + SplineOffset<double>(grid, control, u) - target.ab).squaredNorm(), u);
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
  Eigen::Vector2d last = corners[0] + SplineOffset<double>(grid, control, corners[0]) - target.ab;
  for (int side = 0; side < 4; ++side) {
    const int count = 8 * kSamplesPerSegment * std::max(grid.cols, grid.rows);
    for (int i = 1; i <= count; ++i) {
      const Eigen::Vector2d u = corners[side] + (corners[side + 1] - corners[side]) * i / count;
      const Eigen::Vector2d now = u + SplineOffset<double>(grid, control, u) - target.ab;
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

Status InvertPlane(LensModel family, const LensTerms& terms, const PlaneTarget& target, Eigen::Vector2d* ab) {
  const Eigen::Vector2d start = *ab;
  const NewtonEnd direct = Newton([&](const Eigen::Vector2d& at) { return Distort(family, terms, at); }, target, ab);
  if (Solved(direct, target)) return Status::kOk;
  *ab = start;
  const NewtonEnd end = Continue(family, terms, target, ab);
  if (Solved(end, target)) return Status::kOk;
  // Newton's method with falling residuals can only stop where the determinant vanishes, or on the far side of a fold.
  return end.determinant < 1e-3 ? Status::kOutsideValidRadius : Status::kNotConverged;
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

}  // namespace mvstudio::geometry
