#include "triangulate/take/take.h"

#include <iterator>
#include <utility>

#include "core/stopwatch.h"
#include "triangulate/take/steps.h"

namespace mvstudio::triangulate {
namespace {

/// What auto chooses among, the dearest first.
constexpr PointMethod kCandidates[] = {PointMethod::kRobust, PointMethod::kMidpoint};

/// All candidates choose among the views: whether some are wrong is not to be guessed from a sample of the take.
MethodChoice Choose(const geometry::Rig& rig, const TakeProblem& problem, TakeOptions options, int num_threads) {
  options.select_views = true;
  std::vector<MethodCandidate> candidates;
  double cost = std::size(kCandidates);
  for (const PointMethod method : kCandidates)
    candidates.push_back({std::string(ToString(method)), cost--, SolverFor(rig, problem, options, ByPoint(method))});
  MethodChoiceOptions choice;
  choice.max_points = options.holdout_points;
  choice.tolerance = 0;  // the cheaper one must not be worse by more than the standard error of the difference
  return ChooseMethod(problem.rig, problem.observations, problem.labels, candidates, choice, num_threads);
}

std::vector<CameraDiagnosis> Diagnose(const TakeProblem& problem, const std::vector<TakePoint>& points) {
  std::vector<DiagnosedPoint> diagnosed;
  for (size_t i = 0; i < points.size(); ++i) {
    diagnosed.push_back({points[i].frame, &points[i].point, &problem.observations[i]});
  }
  return DiagnoseCameras(problem.rig, diagnosed);
}

}  // namespace

TakeResult TriangulateTake(const geometry::Rig& rig, const std::vector<DetectedFrame>& frames, const TakeBody& body,
                           const TakeOptions& options, const RunContext& run) {
  ProgressStage stage(run, "triangulate", 3);
  TakeProblem problem = PrepareTake(rig, frames, body, options, run);
  stage.Advance();

  TakeResult result;
  result.method = options.method;
  TakeOptions chosen = options;
  if (options.method.IsAuto()) {
    result.choice = Choose(rig, problem, options, run.num_threads);
    result.method = ByPoint(kCandidates[result.choice.chosen]);
    chosen.select_views = true;
  }
  const PointSolver solve = SolverFor(rig, problem, chosen, result.method);
  result.holdout = HoldOut(problem, solve, options.holdout_points, run.num_threads);
  stage.Advance();

  const Stopwatch watch;
  std::vector<Point> points = SolvePoints(problem, solve, run.num_threads);
  result.solve_s = watch.Seconds();
  for (size_t i = 0; i < points.size(); ++i) {
    const PointLabel& label = problem.labels[i];
    result.points.push_back({label.frame, label.person, label.joint_idx, std::move(points[i])});
  }
  result.cameras = Diagnose(problem, result.points);
  result.sides = std::move(problem.sides);
  result.num_ghosts = problem.num_ghosts;
  result.sigma_px = problem.sigma_px;
  result.num_persons = problem.num_persons;
  result.observations = std::move(problem.observations);
  stage.Advance();
  return result;
}

}  // namespace mvstudio::triangulate
