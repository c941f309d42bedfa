#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "triangulate/point/linear.h"
#include "triangulate/point/robust.h"
#include "triangulate/point/solvers.h"

namespace mvstudio::triangulate {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// Distance to the nearest of the cameras and the largest distance of two of them.
void Extent(const std::vector<View>& views, const Vector3d& x_in_local, double* nearest, double* baseline) {
  double nearest2 = std::numeric_limits<double>::infinity(), baseline2 = 0;
  for (const View& view : views) {
    nearest2 = std::min(nearest2, (x_in_local - view.camera->center_in_local).squaredNorm());
    baseline2 = std::max(baseline2, (view.camera->center_in_local - views.front().camera->center_in_local).squaredNorm());
  }
  *nearest = std::sqrt(nearest2);
  *baseline = std::sqrt(baseline2);
}

/// Where a camera stands it sees nothing.
bool AtACentre(const std::vector<View>& views, const Vector3d& x_in_local) {
  double nearest = 0, baseline = 0;
  Extent(views, x_in_local, &nearest, &baseline);
  return !(nearest > 1e-6 * baseline);
}

/// Whether the depth is determined: the largest standard deviation lies clear below the distance.
bool DepthIsKnown(const Matrix3d& information, double min_parallax_sigmas, double nearest) {
  const double trace = information.inverse().trace();  // at least the largest eigenvalue: spares the exact one as a rule
  const double limit = nearest * nearest / (min_parallax_sigmas * min_parallax_sigmas);
  if (trace > 0 && trace <= limit && trace * information.trace() < 1e12) return true;
  const Eigen::SelfAdjointEigenSolver<Matrix3d> eigen(information, Eigen::EigenvaluesOnly);
  const double weakest = eigen.eigenvalues()[0];
  return weakest > 1e-14 * eigen.eigenvalues()[2] && 1 / weakest <= limit;
}

/// Checks of a refined point, in units of its own uncertainty.
Status CheckGeometry(const std::vector<View>& views, const Refinement& at, const PointOptions& options) {
  double nearest = 0, baseline = 0;
  Extent(views, at.x_in_local, &nearest, &baseline);
  if (!(nearest > 1e-6 * baseline)) return Status::kDegenerate;
  if (!DepthIsKnown(at.information, options.min_parallax_sigmas, nearest)) return Status::kLowParallax;
  if (options.max_distance_m > 0 && nearest > options.max_distance_m) return Status::kFarPoint;
  return at.status;
}

bool HaveOneCentre(const std::vector<View>& views) {
  return std::all_of(views.begin(), views.end(), [&views](const View& view) {
    const double distance = (view.camera->center_in_local - views.front().camera->center_in_local).norm();
    return distance <= 10 * view.camera->rounding_m;
  });
}

/// Why a start could not be refined: rays that are parallel within the noise have no meaningful sign of depth.
Status ExplainFailure(const std::vector<View>& views, Status status, const PointOptions& options) {
  return ParallaxSignificance(views) < options.min_parallax_sigmas ? Status::kLowParallax : status;
}

/// Sum of w (I - r r^T) and w (I - r r^T) c; with `x_in_local`, w is over the squared distance from it too.
bool SolveNormalEquations(const std::vector<View>& views, const Vector3d* near_in_local, Vector3d* x_in_local) {
  constexpr double kMinDeterminant = 1e-8;  // of the matrix with trace 3: rays within 1e-4 rad go the exact way
  Matrix3d sum = Matrix3d::Zero();
  Vector3d right = Vector3d::Zero();
  for (const View& view : views) {
    const Vector3d &ray = view.ray_in_local, &center = view.camera->center_in_local;
    double weight = 1 / (view.sigma_rad * view.sigma_rad);
    if (near_in_local) weight /= (*near_in_local - center).squaredNorm();
    sum.diagonal().array() += weight;
    sum.noalias() -= weight * ray * ray.transpose();
    right += weight * (center - ray.dot(center) * ray);
  }
  const double size = sum.trace() / 3;
  if (!(sum.determinant() > kMinDeterminant * size * size * size)) return false;
  *x_in_local = sum.inverse() * right;
  return x_in_local->allFinite();
}

Refinement RunMethod(const std::vector<View>& views, const PointOptions& options) {
  const Solver solver = SolverOf(options.method);
  const bool refine = solver == Solver::kMaximumLikelihood;
  const LinearPoint start = refine ? QuickStart(views) : Solve(solver, views);
  if (start.status != Status::kOk) return {start.status, {}, {}, 0, 0};
  if (AtACentre(views, start.x_in_local)) return {Status::kDegenerate, {}, {}, 0, 0};
  if (!refine) return Evaluate(views, start.x_in_local);
  Refinement refined = Refine(views, start.x_in_local);
  // Whether a singular matrix passes for a positive one is a matter of rounding: the depth is not determined either way.
  if (refined.status == Status::kDegenerate && !AtACentre(views, refined.x_in_local)) refined.status = Status::kLowParallax;
  return refined;
}

}  // namespace

LinearPoint QuickStart(const std::vector<View>& views) {
  Vector3d once, twice;
  if (!SolveNormalEquations(views, nullptr, &once) || !SolveNormalEquations(views, &once, &twice)) return WeightedLinear(views);
  return {Status::kOk, twice};
}

double WorstResidual(const std::vector<View>& views, const Vector3d& x_in_local) {
  double worst = 0;
  for (const View& view : views) worst = std::max(worst, WhitenedResidual(view, x_in_local));
  return worst;
}

Fit FitViews(const std::vector<View>& views, const PointOptions& options) {
  Fit fit;
  fit.views = views;
  fit.status = Status::kDegenerate;
  if (HaveOneCentre(views)) return fit;
  fit.at = RunMethod(views, options);
  const bool usable = fit.at.status == Status::kOk || fit.at.status == Status::kNotConverged;
  fit.status = usable ? CheckGeometry(views, fit.at, options) : ExplainFailure(views, fit.at.status, options);
  return fit;
}

}  // namespace mvstudio::triangulate
