#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>

#include "core/error.h"
#include "stages/input/take_frames.h"
#include "stages/people/pose_truth.h"
#include "stages/study/tradeoff.h"
#include "stages/tradeoff/run.h"
#include "triangulate/batch/batch.h"
#include "triangulate/take/limbs.h"
#include "triangulate/take/steps.h"

namespace mvstudio::stages {
namespace {

using triangulate::PointMethod;
using triangulate::TakeMethod;

/// The shortest of three runs.
double ShortestSeconds(const std::function<void()>& work) {
  double seconds = std::numeric_limits<double>::infinity();
  for (int run = 0; run < 3; ++run) {
    const double start = NowSeconds();
    work();
    seconds = std::min(seconds, NowSeconds() - start);
  }
  return seconds;
}

triangulate::PointBatch TrialBatch(const triangulate::PreparedRig& rig,
                                   const std::vector<std::vector<triangulate::Observation>>& points) {
  const int64_t count = static_cast<int64_t>(points.size());
  triangulate::PointBatch batch = triangulate::MakeBatch(static_cast<int>(rig.cameras.size()), count);
  for (int64_t i = 0; i < count; ++i) {
    for (const triangulate::Observation& seen : points[static_cast<size_t>(i)]) {
      const size_t at = static_cast<size_t>(seen.camera_idx * count + i);
      batch.x_px[at] = seen.px.x(), batch.y_px[at] = seen.px.y(), batch.sigma_px[at] = seen.sigma_px;
    }
  }
  return batch;
}

triangulate::Point BatchPoint(const triangulate::BatchResult& batch, int64_t i,
                              const std::vector<triangulate::Observation>& observations) {
  triangulate::Point point;
  point.status = batch.StatusOf(i);
  point.num_observations = static_cast<int>(observations.size());
  if (point.status != Status::kOk) return point;
  const size_t at = static_cast<size_t>(i);
  point.x_in_world = {batch.x[at], batch.y[at], batch.z[at]};
  const auto entry = [&](int k) { return batch.covariance[static_cast<size_t>(k * batch.num_points + i)]; };
  point.covariance << entry(0), entry(1), entry(2), entry(1), entry(3), entry(4), entry(2), entry(4), entry(5);
  point.chi_squared = batch.chi_squared[at], point.rms_px = batch.rms_px[at];
  for (size_t k = 0; k < observations.size(); ++k) {
    if (batch.Used(observations[k].camera_idx, i)) point.used.push_back(static_cast<int>(k));
  }
  return point;
}

/// Solved by the batch's kernel; the other methods go point by point, in double.
bool HasKernel(const TakeMethod& method) {
  if (method.kind != TakeMethod::Kind::kPoint) return false;
  const PointMethod kernels[] = {PointMethod::kRobust, PointMethod::kAllViews, PointMethod::kLinear, PointMethod::kMidpoint};
  return std::find(std::begin(kernels), std::end(kernels), method.point) != std::end(kernels);
}

triangulate::BatchOptions KernelOptions(const TriangulateTrial& trial) {
  triangulate::BatchOptions options;
  options.point.method = trial.method.point;
  options.single_precision = trial.precision == "float";
  return options;
}

triangulate::TakeResult TrialTake(const triangulate::TakeProblem& problem, std::vector<triangulate::Point> points) {
  triangulate::TakeResult take;
  for (size_t i = 0; i < points.size(); ++i) {
    const triangulate::PointLabel& label = problem.labels[i];
    take.points.push_back({label.frame, label.person, label.joint_idx, std::move(points[i])});
  }
  return take;
}

/// Share of the joints that two cameras or more see that got a point.
double TrialCoverage(const triangulate::TakeProblem& problem, const std::vector<triangulate::TakePoint>& points) {
  double seen = 0, solved = 0;
  for (size_t i = 0; i < points.size(); ++i) {
    if (problem.observations[i].size() < 2) continue;
    ++seen;
    solved += points[i].point.status == Status::kOk;
  }
  return seen > 0 ? solved / seen : std::nan("");
}

std::vector<triangulate::Point> SolveTimed(const triangulate::TakeProblem& problem, const triangulate::PointSolver& solve,
                                           const TriangulateTrial& trial, double* seconds) {
  std::vector<triangulate::Point> points;
  if (!HasKernel(trial.method)) {
    *seconds = ShortestSeconds([&] { points = SolvePoints(problem, solve, trial.threads); });
    return points;
  }
  const triangulate::PointBatch batch = TrialBatch(problem.rig, problem.observations);
  RunContext run;
  run.num_threads = trial.threads;
  triangulate::BatchResult solved;
  *seconds = ShortestSeconds([&] { solved = TriangulateBatch(problem.rig, batch, KernelOptions(trial), run); });
  for (int64_t i = 0; i < solved.num_points; ++i) {
    points.push_back(BatchPoint(solved, i, problem.observations[static_cast<size_t>(i)]));
  }
  return points;
}

/// The way of a trial for one point, for cameras left out.
triangulate::PointSolver TrialSolver(const TriangulateTradeoffOptions& options, const PoseInput& input,
                                     const triangulate::TakeProblem& problem, const TriangulateTrial& trial) {
  triangulate::PointSolver solve;
  if (HasKernel(trial.method)) {
    solve = [&problem, options = KernelOptions(trial)](const std::vector<triangulate::Observation>& seen) {
      RunContext run;
      run.num_threads = 1;
      return BatchPoint(TriangulateBatch(problem.rig, TrialBatch(problem.rig, {seen}), options, run), 0, seen);
    };
  } else {
    solve = SolverFor(input.rig, problem, options.take, trial.method);
  }
  if (trial.views == 0) return solve;
  return [&problem, solve, views = trial.views](const std::vector<triangulate::Observation>& seen) {
    triangulate::Point point = solve(FewerViews(problem.rig, seen, views));
    point.used.clear();  // they index the fewer ones
    return point;
  };
}

TriangulateTrial TimeTriangulation(const TriangulateTradeoffOptions& options, const PoseInput& input,
                                   const triangulate::TakeProblem& problem, TriangulateTrial trial) {
  const triangulate::PointSolver solve = TrialSolver(options, input, problem, trial);
  triangulate::TakeProblem thin = problem;
  for (auto& seen : thin.observations) {
    if (trial.views > 0) seen = FewerViews(problem.rig, seen, trial.views);
  }
  double seconds = 0;
  const triangulate::TakeResult take = TrialTake(thin, SolveTimed(thin, solve, trial, &seconds));
  trial.points_per_s = static_cast<double>(take.points.size()) / seconds;
  trial.coverage = TrialCoverage(problem, take.points);
  trial.limb_std_mm = 1000 * MeanLimbStd(MeasureLimbs(take.points, input.limbs));
  trial.holdout = HoldOut(problem, solve, options.take.holdout_points, trial.threads).all;
  if (!options.truth.empty()) {
    const TruthComparison truth =
        CompareWithTruth(ToPose3d(take, input.skeleton), options.truth, {options.align_truth, options.marker_unit});
    if (truth.comparison.num > 0) trial.truth_mm = truth.comparison.median_mm;
    trial.why_no_truth = truth.comparison.why_none;
  }
  return trial;
}

void CheckWays(const TriangulateTradeoffOptions& options) {
  for (const TakeMethod& method : options.methods) {
    if (method.IsAuto()) throw UsageError("option 'methods' compares the methods that auto chooses among; name them");
  }
  for (const std::string& precision : options.precisions) {
    if (precision != "double" && precision != "float")
      throw UsageError("option 'precisions': double or float, not " + precision);
  }
  for (const int views : options.views) {
    if (views != 0 && views < 2) throw UsageError("option 'views': a point needs 2 views; 0 stands for all");
  }
}

std::vector<TriangulateTrial> TrialsOf(const TriangulateTradeoffOptions& options) {
  CheckWays(options);
  std::vector<TriangulateTrial> trials;
  for (const TakeMethod& method : options.methods) {
    for (const std::string& precision : options.precisions) {
      if (precision == "float" && !HasKernel(method)) continue;
      for (const int views : options.views) {
        for (const int threads : options.threads) {
          TriangulateTrial& trial = trials.emplace_back();
          trial.method = method, trial.precision = precision, trial.views = views, trial.threads = std::max(threads, 1);
        }
      }
    }
  }
  return trials;
}

}  // namespace

TriangulateTradeoffReport RunTriangulateTradeoff(const TriangulateTradeoffOptions& options, const RunContext& run) {
  TriangulateTradeoffReport report;
  report.options = options;
  std::vector<TriangulateTrial> trials = TrialsOf(options);
  std::vector<std::string> inputs;
  for (const NamedPath& camera : options.pose.pose2d) inputs.push_back(camera.path);
  inputs.push_back(options.pose.calib), inputs.push_back(options.truth);
  const std::unique_ptr<OutputFolder> place = TradeoffPlace(options.out, "triangulate", inputs);
  const PoseInput input = ReadPoseInput(options.pose, &report.notes);
  const triangulate::TakeProblem problem = PrepareTake(input.rig, input.frames, BodyOf(input.skeleton), options.take, run);
  const auto seen_twice = [](const std::vector<triangulate::Observation>& seen) { return seen.size() > 1; };
  if (std::none_of(problem.observations.begin(), problem.observations.end(), seen_twice)) return report;
  report.sigma_px = problem.sigma_px;
  ProgressStage stage(run, "tradeoff", static_cast<int64_t>(trials.size()));
  const bool truth = !options.truth.empty();
  std::vector<TradeoffPoint> points;
  for (TriangulateTrial& trial : trials) {
    trial = TimeTriangulation(options, input, problem, trial);
    stage.Advance(1, trial.Name());
    points.push_back({trial.Name(), 1e6 / trial.points_per_s, truth ? trial.truth_mm : trial.holdout.median_px});
  }
  const std::vector<bool> on_front = ParetoFront(points);
  for (size_t i = 0; i < trials.size(); ++i) trials[i].on_front = on_front[i];
  report.trials = std::move(trials);
  if (options.out.empty()) return report;
  report.page =
      WriteTradeoffPage({"triangulate", "Triangulation: speed against accuracy", "Ways to triangulate: time against error",
                         "time for a point (microseconds)",
                         truth ? "median distance from the truth (mm)" : "median error with the camera left out (px)"},
                        points, options.out);
  return report;
}

}  // namespace mvstudio::stages
