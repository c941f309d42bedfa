#include <algorithm>
#include <cmath>

#include "core/statistics.h"
#include "geometry/rigid/decompositions.h"
#include "triangulate/skeleton/problem.h"

namespace mvstudio::triangulate::internal {
namespace {

constexpr double kCarries = 0.2;  ///< least weight of a detection that carries its point: 4 sigmas

Unknowns Moved(const SkeletonProblem& problem, const Unknowns& from, const Eigen::VectorXd& step, double factor) {
  Unknowns to = from;
  for (size_t cell = 0; cell < problem.variable.size(); ++cell) {
    if (problem.variable[cell] >= 0) to.x_in_local[cell] += factor * step.segment<3>(3 * problem.variable[cell]);
  }
  for (size_t b = 0; b < problem.length_node.size(); ++b) {
    if (problem.length_node[b] >= 0) to.length_m[b] += factor * step[problem.LengthRow(b)];
  }
  return to;
}

/// A stretch takes seconds; its steps do not.
void RequireGoOn(const RunContext& run) {
  if (run.progress && run.progress->Cancelled()) throw CancelledError("interrupted");
}

/// Gauss-Newton on the reweighted problem, steps halved until the cost falls. False when the system is singular.
bool Minimise(const SkeletonProblem& problem, int max_iterations, const RunContext& run, Equations* equations, Unknowns* at) {
  for (int iteration = 0; iteration < max_iterations; ++iteration) {
    RequireGoOn(run);
    const double here = equations->Linearize(*at);
    if (!std::isfinite(here)) return false;
    const std::optional<Eigen::VectorXd> step = equations->Step();
    if (!step) return false;
    double fraction = 1;
    Unknowns next = Moved(problem, *at, *step, fraction);
    double cost = equations->Cost(next);
    for (int halving = 0; halving < 6 && !(cost <= here); ++halving) {
      fraction /= 2;
      next = Moved(problem, *at, *step, fraction);
      cost = equations->Cost(next);
    }
    if (!(cost <= here)) return true;  // nothing left to gain
    *at = std::move(next);
    if (here - cost < 1e-6 * here) return true;
  }
  return true;
}

/// Fit of a point to its detections.
void Describe(const SkeletonProblem& problem, size_t cell, const Eigen::Vector3d& x_in_local, Point* point) {
  const Cell& of = problem.window->cells[cell];
  if (problem.terms->robust) point->used.clear();
  double sum_px = 0;
  point->chi_squared = 0;
  for (size_t i = 0; i < of.observations.size(); ++i) {
    const Observation& seen = of.observations[i];
    const PreparedCamera& camera = problem.rig->cameras[static_cast<size_t>(seen.camera_idx)];
    const bool used = std::binary_search(of.point.used.begin(), of.point.used.end(), static_cast<int>(i));
    const auto projection = camera.projector.Project(camera.ToCam(x_in_local));
    if (projection.status != Status::kOk || (!problem.terms->robust && !used)) continue;
    const double squared_px = (projection.px - seen.px).squaredNorm(), squared = squared_px / (seen.sigma_px * seen.sigma_px);
    if (problem.terms->robust && !(Weight(squared, kRobustSigmas) >= kCarries)) continue;
    if (problem.terms->robust) point->used.push_back(static_cast<int>(i));
    sum_px += squared_px, point->chi_squared += squared;
  }
  point->rms_px = point->used.empty() ? 0 : std::sqrt(sum_px / static_cast<double>(point->used.size()));
}

double LargestSigma(const Eigen::Matrix3d& covariance) { return std::sqrt(geometry::SymmetricEigenvalues(covariance)[2]); }

/// Points with their covariances; bridged ones only where they are determined well enough.
std::vector<Point> ToPoints(const SkeletonProblem& problem, const Unknowns& at, const std::vector<Eigen::Matrix3d>& inverse) {
  const Window& window = *problem.window;
  const double shared = problem.terms->shared_error;
  std::vector<Point> points = PointsOf(window);
  for (size_t j = 0; j < window.num_joints; ++j) {
    std::vector<double> sigmas, ratios;
    for (const bool bridged : {false, true}) {
      const double limit = problem.terms->max_fill_sigmas * UpperMedian(sigmas), ratio = UpperMedian(ratios);
      for (size_t f = 0; f < window.frames.size(); ++f) {
        const size_t cell = f * window.num_joints + j;
        if (problem.variable[cell] < 0 || IsOk(window, f, j) == bridged) continue;
        const Eigen::Matrix3d& covariance = inverse[static_cast<size_t>(problem.variable[cell])];
        const double sigma = LargestSigma(covariance);
        if (bridged && !(sigma <= limit)) continue;
        Point& point = points[cell];
        const Eigen::Matrix3d single = point.covariance - point.calibration_covariance;
        if (!bridged) sigmas.push_back(sigma), ratios.push_back(single.trace() / covariance.trace());
        if (bridged) {
          point.used.clear();
          const Point& seen =  // the last time step at which it was, which is there
              window.At(*NearestOk(window, f, j, -1, problem.terms->max_fill_frames), j).point;
          point.calibration_covariance = seen.calibration_covariance;
          point.num_unknown_cameras = seen.num_unknown_cameras;
        }
        point.status = Status::kOk;
        point.x_in_world = problem.rig->origin_in_world + at.x_in_local[cell];
        point.covariance = (1 - shared) * covariance + shared * (bridged ? Eigen::Matrix3d(ratio * covariance) : single) +
                           point.calibration_covariance;
        Describe(problem, cell, at.x_in_local[cell], &point);
      }
    }
  }
  return points;
}

}  // namespace

WindowSolution SolveWindow(const PreparedRig& rig, const Window& window, const Bones& bones,
                           const std::vector<KnownLength>& known, const Terms& terms, int max_iterations,
                           const RunContext& run) {
  WindowSolution solution;
  for (const Cell& cell : window.cells) solution.points.push_back(cell.point);
  solution.lengths = known;
  for (KnownLength& each : solution.lengths) each.sigma_m = 0;
  if (!terms.Any()) return solution;
  Unknowns at;
  const SkeletonProblem problem = MakeProblem(rig, window, bones, known, terms, &at);
  if (problem.num_positions == 0) return solution;
  Equations equations(problem);
  solution.solved =
      Minimise(problem, max_iterations, run, &equations, &at) && std::isfinite(equations.Linearize(at)) && equations.Step();
  if (!solution.solved) return solution;
  RequireGoOn(run);
  const std::vector<Eigen::Matrix3d> inverse = equations.InverseDiagonal();
  solution.points = ToPoints(problem, at, inverse);
  for (size_t b = 0; b < bones.size(); ++b) {
    if (problem.length_node[b] < 0) continue;
    solution.lengths[b] = {at.length_m[b], std::sqrt(inverse[static_cast<size_t>(problem.length_node[b])](0, 0))};
  }
  return solution;
}

}  // namespace mvstudio::triangulate::internal
