#include "calib/check/rig_compare.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "core/check.h"
#include "geometry/solve/least_squares.h"

namespace mvstudio::calib {
namespace {

using geometry::Rigid3;
using geometry::Vector6d;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

/// A pixel of the reference with its ray.
struct GridPoint {
  int row, col;
  Eigen::Vector2d px;
  Eigen::Vector3d ray;
  bool in_focus;
};

struct Grid {
  Eigen::VectorXd u, v;
  std::vector<GridPoint> points;
};

Grid MakeGrid(const geometry::Camera& reference, const ProjectionDiffOptions& options) {
  Grid grid;
  const int cols = options.grid_cols;
  const int rows = std::max(2, static_cast<int>(std::lround(1.0 * cols * reference.height_px / reference.width_px)));
  grid.u = Eigen::VectorXd::LinSpaced(cols, 0, reference.width_px - 1);
  grid.v = Eigen::VectorXd::LinSpaced(rows, 0, reference.height_px - 1);
  const geometry::Projector projector(reference);
  const Eigen::Vector2d centre(0.5 * (reference.width_px - 1), 0.5 * (reference.height_px - 1));
  const double radius = options.focus * centre.norm() * (1 + 1e-9);
  for (int r = 0; r < rows; ++r) {
    for (int c = 0; c < cols; ++c) {
      const Eigen::Vector2d px(grid.u[c], grid.v[r]);
      const geometry::Unprojection ray = projector.Unproject(px);
      if (ray.status == Status::kOk) grid.points.push_back({r, c, px, ray.ray_in_cam, (px - centre).norm() <= radius});
    }
  }
  return grid;
}

/// Moved point: a direction for an infinite range.
Eigen::Vector3d Moved(const Rigid3& cam_from_reference, const Eigen::Vector3d& ray, double range_m) {
  if (std::isinf(range_m)) return cam_from_reference.rotation * ray;
  return cam_from_reference * Eigen::Vector3d(range_m * ray);
}

/// The cost is the mean squared difference, for their number may change.
struct Normal : geometry::NormalEquations<6> {
  int count = 0;
};

struct ImpliedProblem : geometry::LeastSquaresProblem<6, Rigid3, Normal> {
  const geometry::Projector& projector;
  const Grid& grid;
  const std::vector<double>& ranges;

  ImpliedProblem(const geometry::Projector& of, const Grid& seen, const std::vector<double>& at)
      : projector(of), grid(seen), ranges(at) {}
  Rigid3 Retract(const Rigid3& from, const Vector6d& step) const { return geometry::Perturb(step, from); }

  void Add(const GridPoint& point, double range, const Rigid3& cam_from_reference, Normal* normal) const {
    const Eigen::Vector3d x = Moved(cam_from_reference, point.ray, range);
    const geometry::ProjectionWithJacobians projection = projector.ProjectWithJacobians(x);
    if (projection.status != Status::kOk) return;
    const bool far = std::isinf(range);
    const Eigen::Vector3d rotated = far ? x : Eigen::Vector3d(x - cam_from_reference.translation);
    Eigen::Matrix<double, 3, 6> d_x;
    d_x << 0, rotated.z(), -rotated.y(), 1, 0, 0, -rotated.z(), 0, rotated.x(), 0, 1, 0, rotated.y(), -rotated.x(), 0, 0, 0, 1;
    if (far) d_x.rightCols<3>().setZero();
    const Eigen::Matrix<double, 2, 6> j = projection.d_px_d_x * d_x;
    const Eigen::Vector2d residual = projection.px - point.px;
    normal->h += j.transpose() * j;
    normal->g += j.transpose() * residual;
    normal->cost += residual.squaredNorm();
    ++normal->count;
  }

  bool Linearize(const Rigid3& cam_from_reference, Normal* normal) const {
    for (const double range : ranges) {
      for (const GridPoint& point : grid.points) {
        if (point.in_focus) Add(point, range, cam_from_reference, normal);
      }
    }
    if (normal->count > 0) normal->cost /= normal->count;
    return normal->count > 0;
  }

  Vector6d SolveStep(const Normal& at, double damping) const {
    return geometry::DampedStep(at.h, at.g, damping, 1e-12 * (1 + at.h.trace()));
  }

  geometry::StepVerdict Judge(const geometry::LeastSquaresOptions& options, const Vector6d& step, const Normal& at,
                              const Normal* trial) const {
    if (trial && 2 * trial->count < at.count) return geometry::StepVerdict::kRefuse;
    return LeastSquaresProblem::Judge(options, step, at, trial);
  }
};

/// The starts are so near that a few steps do.
Rigid3 FitImplied(const geometry::Projector& projector, const Grid& grid, const std::vector<double>& ranges) {
  geometry::LeastSquaresOptions options;
  options.first_damping = 1e-6, options.least_damping = 1e-15, options.max_damping = 1e8;
  options.cost_tolerance = 1e-15, options.step_tolerance = 1e-14;
  return geometry::SolveLeastSquares(ImpliedProblem(projector, grid, ranges), Rigid3(), options).state;
}

ProjectionDiffAtRange AtRange(const geometry::Projector& projector, const Grid& grid, const Rigid3& cam_from_reference,
                              double range_m) {
  ProjectionDiffAtRange at;
  at.range_m = range_m;
  at.grid_px = at.grid_dx = at.grid_dy = Eigen::MatrixXd::Constant(grid.v.size(), grid.u.size(), kNaN);
  double sum = 0;
  for (const GridPoint& point : grid.points) {
    const geometry::Projection projection = projector.Project(Moved(cam_from_reference, point.ray, range_m));
    if (projection.status != Status::kOk) continue;
    const Eigen::Vector2d difference = projection.px - point.px;
    at.grid_px(point.row, point.col) = difference.norm();
    at.grid_dx(point.row, point.col) = difference.x();
    at.grid_dy(point.row, point.col) = difference.y();
    at.max_px = std::max(at.max_px, difference.norm());
    sum += difference.squaredNorm();
    ++at.num_points;
  }
  at.rms_px = at.num_points > 0 ? std::sqrt(sum / at.num_points) : kNaN;
  return at;
}

double CentreDifference(const geometry::Projector& projector, const geometry::Camera& reference,
                        const Rigid3& cam_from_reference, double range_m) {
  const Eigen::Vector2d centre(0.5 * (reference.width_px - 1), 0.5 * (reference.height_px - 1));
  const geometry::Unprojection ray = geometry::Unproject(reference, centre);
  if (ray.status != Status::kOk) return kNaN;
  const geometry::Projection projection = projector.Project(Moved(cam_from_reference, ray.ray_in_cam, range_m));
  return projection.status == Status::kOk ? (projection.px - centre).norm() : kNaN;
}

}  // namespace

ProjectionDiff CompareProjection(const geometry::Camera& camera, const geometry::Camera& reference,
                                 const ProjectionDiffOptions& options) {
  MVS_CHECK(options.grid_cols >= 2 && options.grid_cols <= 1000, "grid of " << options.grid_cols << " columns");
  MVS_CHECK(options.focus > 0, "focus " << options.focus);
  for (const double range : options.ranges_m) MVS_CHECK(range > 0, "range " << range << " m");
  ProjectionDiff diff;
  if (camera.width_px != reference.width_px || camera.height_px != reference.height_px) {
    diff.status = Status::kDegenerate;
    return diff;
  }
  const Grid grid = MakeGrid(reference, options);
  const geometry::Projector projector(camera);
  if (options.implied) diff.cam_from_reference = FitImplied(projector, grid, options.ranges_m);
  diff.rotation_rad = geometry::RotationLog(diff.cam_from_reference.rotation).norm();
  diff.translation_m = diff.cam_from_reference.translation.norm();
  diff.grid_axes_px = Eigen::Matrix2Xd::Constant(2, std::max(grid.u.size(), grid.v.size()), kNaN);
  diff.grid_axes_px.row(0).head(grid.u.size()) = grid.u.transpose();
  diff.grid_axes_px.row(1).head(grid.v.size()) = grid.v.transpose();
  for (const double range : options.ranges_m) {
    diff.ranges.push_back(AtRange(projector, grid, diff.cam_from_reference, range));
    diff.ranges.back().centre_px = CentreDifference(projector, reference, diff.cam_from_reference, range);
    if (diff.ranges.back().num_points == 0) diff.status = Status::kTooFewViews;
  }
  return diff;
}

}  // namespace mvstudio::calib
