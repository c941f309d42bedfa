#include "triangulate/take/take.h"

#include <algorithm>
#include <iterator>
#include <limits>
#include <utility>

#include "core/stopwatch.h"
#include "triangulate/take/blocks.h"
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

std::vector<CameraDiagnosis> Diagnose(const PreparedRig& rig, const TakeResult& take) {
  std::vector<DiagnosedPoint> diagnosed;
  diagnosed.reserve(take.points.size());
  for (size_t i = 0; i < take.points.size(); ++i)
    diagnosed.push_back({take.points[i].frame, &take.points[i].point, &take.observations[i]});
  return DiagnoseCameras(rig, diagnosed);
}

/// At most about `max_points` points at equal steps through the take, as HoldOut takes them of a problem.
std::vector<size_t> EveryPoint(size_t count, int max_points) {
  std::vector<size_t> points;
  const size_t stride = std::max<size_t>(1, count / static_cast<size_t>(std::max(max_points, 1)));
  for (size_t i = 0; max_points > 0 && i < count; i += stride) points.push_back(i);
  return points;
}

}  // namespace

struct TakeBlocks::Impl {
  Impl(const geometry::Rig& rig, const std::vector<DetectedFrame>& frames, const TakeBody& body, const TakeOptions& options,
       const RunContext& run)
      : stage(run, "triangulate", 3), people(rig, frames, body, options, run, &problem), num_threads(run.num_threads) {}

  void Keep(const TakeResult& block);

  ProgressStage stage;
  TakeProblem problem;  // of the block in work
  TakePeople people;
  PointSolver solve;
  TakeResult result;
  int num_threads = 1;
  size_t next_frame = 0, keep_every = 1, num_shown = 0;  // num_shown: frames with points
};

/// Adds what is kept of a block to the result.
void TakeBlocks::Impl::Keep(const TakeResult& block) {
  for (size_t i = 0; i < block.points.size(); ++i) {
    num_shown += i == 0 || block.points[i].frame != block.points[i - 1].frame;
    if ((num_shown - 1) % keep_every != 0) continue;
    result.points.push_back(block.points[i]), result.observations.push_back(block.observations[i]);
  }
}

TakeBlocks::TakeBlocks(const geometry::Rig& rig, const std::vector<DetectedFrame>& frames, const TakeBody& body,
                       const TakeOptions& options, const RunContext& run, size_t max_kept_frames)
    : impl_(std::make_unique<Impl>(rig, frames, body, options, run)) {
  TakeProblem& problem = impl_->problem;
  TakeResult& result = impl_->result;
  impl_->stage.Advance();
  result.method = options.method;
  TakeOptions chosen = options;
  if (options.method.IsAuto()) {
    impl_->people.Collect(impl_->people.Spread(3, static_cast<size_t>(options.holdout_points)), &problem);
    result.choice = Choose(rig, problem, options, run.num_threads);
    result.method = ByPoint(kCandidates[result.choice.chosen]);
    chosen.select_views = true;
  }
  impl_->solve = SolverFor(rig, problem, chosen, result.method);
  impl_->people.Collect(EveryPoint(impl_->people.num_points(), options.holdout_points), &problem);
  result.holdout = HoldOut(problem, impl_->solve, std::numeric_limits<int>::max(), run.num_threads);
  result.sides = problem.sides;
  result.num_ghosts = problem.num_ghosts, result.num_persons = problem.num_persons, result.sigma_px = problem.sigma_px;
  const size_t num_frames = impl_->people.num_frames(), num_points = impl_->people.num_points();
  impl_->keep_every = num_frames / max_kept_frames + (num_frames % max_kept_frames != 0);
  const size_t num_kept =
      num_points / std::max<size_t>(1, impl_->keep_every) + num_points / std::max<size_t>(1, num_frames) + 1;
  result.points.reserve(num_kept), result.observations.reserve(num_kept);
  impl_->stage.Advance();
}

TakeBlocks::~TakeBlocks() = default;

bool TakeBlocks::Next(TakeResult* block) {
  TakeProblem& problem = impl_->problem;
  const size_t begin = impl_->next_frame, end = std::min(begin + kTakeBlockFrames, impl_->people.num_frames());
  *block = {};
  impl_->stage.Advance(begin == end ? 1 : 0);  // throws before the caller's files are put in place
  if (begin == end) return false;
  impl_->people.Collect(begin, end, &problem);
  const Stopwatch watch;
  std::vector<Point> points = SolvePoints(problem, impl_->solve, impl_->num_threads);
  block->solve_s = watch.Seconds(), block->num_persons = problem.num_persons;
  impl_->result.solve_s += block->solve_s;
  block->points.reserve(points.size());
  for (size_t i = 0; i < points.size(); ++i) {
    const PointLabel& label = problem.labels[i];
    block->points.push_back({label.frame, label.person, label.joint_idx, std::move(points[i])});
  }
  block->observations = std::move(problem.observations);
  impl_->Keep(*block);
  impl_->next_frame = end;
  return true;
}

TakeResult TakeBlocks::Finish() {
  impl_->result.cameras = Diagnose(impl_->problem.rig, impl_->result);
  return std::move(impl_->result);
}

TakeResult TriangulateTake(const geometry::Rig& rig, const std::vector<DetectedFrame>& frames, const TakeBody& body,
                           const TakeOptions& options, const RunContext& run) {
  TakeBlocks blocks(rig, frames, body, options, run, std::numeric_limits<size_t>::max());
  for (TakeResult block; blocks.Next(&block);) {
  }
  return blocks.Finish();
}

}  // namespace mvstudio::triangulate
