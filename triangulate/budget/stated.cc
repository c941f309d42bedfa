#include "triangulate/budget/stated.h"

#include <cmath>
#include <unordered_map>

#include "core/statistics.h"
#include "geometry/rig/rig_covariance.h"
#include "triangulate/budget/reliability.h"
#include "triangulate/take/steps.h"

namespace mvstudio::triangulate {
namespace {

constexpr size_t kHeldOutJoints = 1500;  // about; each gives a sample a camera
constexpr double kGrossSigmas = 4;

struct HeldOut {
  int camera_idx = 0;
  Eigen::Vector2d residual_px;
  double sigma_px = 0;
};

/// Joints and held-out samples by what they are of.
struct Solved {
  std::unordered_map<int64_t, Eigen::Vector3d> joints;
  std::unordered_map<int64_t, HeldOut> held_out;
};

class StatedTake {
 public:
  StatedTake(const BudgetTake& take, const RunContext& run) : take_(take), run_(run), options_(take.options) {
    run_.progress = nullptr;
    base_ = Prepared(take.clocks);
    options_.sigma_px = base_.sigma_px;
    options_.select_views |= options_.method.IsAuto();
    stride_ = static_cast<int64_t>(std::max<size_t>(1, base_.labels.size() / kHeldOutJoints));
  }

  const TakeProblem& base() const { return base_; }

  Solved With(const TakeProblem& problem) const {
    const PointSolver solve = SolverFor(take_.rig, problem, options_, options_.method);
    const std::vector<Point> points = SolvePoints(problem, solve, run_.num_threads);
    Solved solved;
    std::vector<std::vector<Observation>> observations;
    std::vector<int64_t> keys;
    for (size_t i = 0; i < points.size(); ++i) {
      const int64_t key = KeyOf(problem.labels[i]);
      if (points[i].status == Status::kOk) solved.joints[key] = points[i].x_in_world;
      if (key % stride_ != 0) continue;
      observations.push_back(problem.observations[i]), keys.push_back(key);
    }
    const auto cameras = static_cast<int64_t>(take_.rig.cameras.size());
    for (const LeftOutSample& s : LeaveOneCameraOut(problem.rig, observations, solve, run_.num_threads)) {
      if (s.status == Status::kOk)
        solved.held_out[keys[s.point] * cameras + s.camera_idx] = {s.camera_idx, s.residual_px, s.sigma_px};
    }
    return solved;
  }

  TakeProblem OtherRig(Rng* rng) const {
    TakeProblem problem = base_;
    problem.rig = Prepare(DrawRig(take_.rig, rng), options_.ignore_distortion);
    return problem;
  }

  TakeProblem OtherClocks(Rng* rng) const {
    std::vector<Clock> clocks = take_.clocks;
    for (size_t c = 0; c < clocks.size(); ++c) {
      const double sigma = take_.sigma_frames[c];
      if (std::isfinite(sigma)) clocks[c].offset_frames += sigma * rng->Normal();
    }
    return Prepared(clocks);
  }

  TakeProblem OtherJoints(Rng* rng) const {
    TakeProblem problem = base_;
    for (auto& point : problem.observations) {
      for (Observation& seen : point) seen.px += seen.sigma_px * Eigen::Vector2d(rng->Normal(), rng->Normal());
    }
    return problem;
  }

 private:
  TakeProblem Prepared(const std::vector<Clock>& clocks) const {
    return PrepareTake(take_.rig, ApplyClocks(take_.frames, clocks, kMeasuredBeyond), take_.body, options_, run_);
  }
  int64_t KeyOf(const PointLabel& label) const {
    return (int64_t{label.frame} * options_.max_persons + label.person) * take_.body.num_joints + label.joint_idx;
  }

  const BudgetTake& take_;
  RunContext run_;
  TakeOptions options_;
  TakeProblem base_;
  int64_t stride_ = 1;
};

bool States(const BudgetTake& take, BudgetStage stage) {
  if (stage == BudgetStage::kCalibration) return StatedCovarianceOf(take.rig).AnyKnown();
  if (stage == BudgetStage::kJoints2d) return true;
  for (const double sigma : take.sigma_frames) {
    if (sigma > 0) return true;
  }
  return false;
}

/// Growth of the mean square distance, over the samples that both have.
double Growth(const Solved& base, const Solved& other) {
  double sum = 0, count = 0;
  for (const auto& [key, sample] : base.held_out) {
    const auto found = other.held_out.find(key);
    if (found == other.held_out.end()) continue;
    sum += found->second.residual_px.squaredNorm() - sample.residual_px.squaredNorm(), ++count;
  }
  return count > 0 ? sum / count : 0;
}

double MeanSquareMove(const Solved& base, const Solved& other) {
  double sum = 0, count = 0;
  for (const auto& [key, x] : base.joints) {
    const auto found = other.joints.find(key);
    if (found != other.joints.end()) sum += (found->second - x).squaredNorm(), ++count;
  }
  return count > 0 ? sum / count : 0;
}

StatedShare ShareOf(const BudgetTake& given, const StatedTake& take, const Solved& base, BudgetStage stage, int seeds,
                    const RunContext& run) {
  StatedShare share;
  share.stage = stage, share.stated = States(given, stage);
  if (!share.stated) return share;
  std::vector<double> growths;
  double moved = 0;
  Rng rng(run.seed + static_cast<uint64_t>(stage));
  for (int k = 0; k < seeds; ++k) {
    const Solved other = take.With(stage == BudgetStage::kCalibration ? take.OtherRig(&rng)
                                   : stage == BudgetStage::kSync      ? take.OtherClocks(&rng)
                                                                      : take.OtherJoints(&rng));
    growths.push_back(Growth(base, other)), moved += MeanSquareMove(base, other) / seeds;
  }
  share.share_px2 = Mean(growths), share.moved_mm = 1000 * std::sqrt(moved);
  share.share_error_px2 = seeds > 1 ? SampleDeviation(growths) / std::sqrt(seeds) : 0;
  return share;
}

/// Medians of the residuals of one camera.
void SetShift(const Solved& base, int camera_idx, StatedCamera* camera) {
  std::vector<double> x, y;
  for (const auto& entry : base.held_out) {
    if (entry.second.camera_idx != camera_idx) continue;
    x.push_back(entry.second.residual_px.x()), y.push_back(entry.second.residual_px.y());
  }
  camera->num = static_cast<int>(x.size());
  if (camera->num > 0) camera->shift_px = {LinearQuantile(x, 0.5), LinearQuantile(y, 0.5)};
}

/// What of the mean square is constant, and what is gross.
void DescribeRest(const BudgetTake& take, const Solved& base, StatedBudget* budget) {
  const double count = static_cast<double>(base.held_out.size());
  for (size_t c = 0; c < take.rig.cameras.size(); ++c) {
    StatedCamera& camera = budget->cameras.emplace_back();
    camera.name = take.rig.cameras[c].camera.name;
    SetShift(base, static_cast<int>(c), &camera);
    if (camera.num > 0) camera.share_px2 = camera.num / count * camera.shift_px.squaredNorm();
    budget->shifts_px2 += camera.share_px2;
  }
  for (const auto& entry : base.held_out) {
    const HeldOut& sample = entry.second;
    budget->mean_px2 += sample.residual_px.squaredNorm() / count;
    const Eigen::Vector2d about = sample.residual_px - budget->cameras[static_cast<size_t>(sample.camera_idx)].shift_px;
    if (about.squaredNorm() > 2 * kGrossSigmas * kGrossSigmas * sample.sigma_px * sample.sigma_px)
      budget->gross_px2 += about.squaredNorm() / count;
  }
}

}  // namespace

StatedBudget MeasureStatedBudget(const BudgetTake& given, int seeds, const RunContext& run) {
  const StatedTake take(given, run);
  const Solved base = take.With(take.base());
  StatedBudget budget;
  budget.num = static_cast<int>(base.held_out.size()), budget.sigma_px = take.base().sigma_px;
  DescribeRest(given, base, &budget);
  if (budget.num == 0) return budget;
  budget.rest_px2 = budget.mean_px2;
  ProgressStage progress(run, "error budget", 3);
  for (const BudgetStage stage : {BudgetStage::kCalibration, BudgetStage::kSync, BudgetStage::kJoints2d}) {
    budget.stages.push_back(ShareOf(given, take, base, stage, seeds, run));
    budget.rest_px2 -= budget.stages.back().share_px2;
    progress.Advance();
  }
  return budget;
}

}  // namespace mvstudio::triangulate
