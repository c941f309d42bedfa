#include "triangulate/budget/budget.h"

#include <algorithm>
#include <cmath>

#include "core/statistics.h"
#include "core/units.h"
#include "geometry/rig/alignment.h"
#include "geometry/rig/rig_covariance.h"
#include "triangulate/budget/shapley.h"
#include "triangulate/budget/substitute.h"

namespace mvstudio::triangulate {
namespace {

using internal::BudgetErrors;
using internal::Substitution;
using internal::Truths;

constexpr size_t kSets = size_t{1} << kNumBudgetStages;
constexpr size_t kBootstrapBlocks = 25;
constexpr int kBootstrapDraws = 200;

/// Sums of distances by set of stages and block of the take, over the distances that every set has.
struct BlockSums {
  std::vector<std::vector<double>> sums;  // [set][block]
  std::vector<double> counts;             // [block]

  std::vector<double> Means(const std::vector<size_t>& blocks) const {
    std::vector<double> means(sums.size());
    double count = 0;
    for (const size_t b : blocks) count += counts[b];
    for (size_t s = 0; s < sums.size(); ++s) {
      for (const size_t b : blocks) means[s] += sums[s][b] / count;
    }
    return means;
  }
};

/// `value` of a set and a key, for the keys of `sets[of]`; a key without one in any set is left out.
template <class Value>
BlockSums SumUp(const Substitution& take, const std::vector<BudgetErrors>& sets, size_t of, bool px, const Value& value) {
  const size_t blocks = std::min(kBootstrapBlocks, take.num_steps());
  BlockSums result{std::vector<std::vector<double>>(sets.size(), std::vector<double>(blocks)), std::vector<double>(blocks)};
  std::vector<double> values(sets.size());
  for (const auto& entry : px ? sets[of].px : sets[of].mm) {
    for (size_t s = 0; s < sets.size(); ++s) values[s] = value(sets[s], entry.first);
    if (!std::all_of(values.begin(), values.end(), [](double v) { return std::isfinite(v); })) continue;
    const size_t block = take.StepOf(entry.first, px) * blocks / take.num_steps();
    result.counts[block] += 1;
    for (size_t s = 0; s < sets.size(); ++s) result.sums[s][block] += values[s];
  }
  return result;
}

double DistanceIn(const std::unordered_map<int64_t, double>& distances, int64_t key) {
  const auto found = distances.find(key);
  return found == distances.end() ? std::nan("") : found->second;
}

/// 2.5 % and 97.5 % of draws, which may be none.
void SetInterval(const std::vector<double>& draws, double* low, double* high) {
  *low = LinearQuantile(draws, 0.025), *high = LinearQuantile(draws, 0.975);
}

BudgetMeasure MeasureShares(const BlockSums& sums, uint64_t seed) {
  BudgetMeasure measure;
  std::vector<size_t> all;
  for (size_t b = 0; b < sums.counts.size(); ++b) {
    if (sums.counts[b] > 0) all.push_back(b), measure.num += static_cast<int>(sums.counts[b]);
  }
  if (measure.num == 0) return measure;
  const std::vector<double> means = sums.Means(all), shares = ShapleyShares(means);
  std::vector<std::vector<double>> draws(kNumBudgetStages + 1);
  Rng rng(seed);
  for (int k = 0; k < kBootstrapDraws; ++k) {
    std::vector<size_t> drawn;
    while (drawn.size() < all.size()) drawn.push_back(all[static_cast<size_t>(rng.Index(static_cast<int64_t>(all.size())))]);
    const std::vector<double> other = sums.Means(drawn), parts = ShapleyShares(other);
    for (size_t i = 0; i < kNumBudgetStages; ++i) draws[i].push_back(parts[i]);
    draws.back().push_back(other.front());
  }
  measure.now = means.front(), measure.rest = means.back();
  SetInterval(draws.back(), &measure.low, &measure.high);
  for (size_t i = 0; i < kNumBudgetStages; ++i) {
    measure.stages[i].share = shares[i], measure.stages[i].alone = means[0] - means[size_t{1} << i];
    SetInterval(draws[i], &measure.stages[i].low, &measure.stages[i].high);
  }
  return measure;
}

/// By how much an error falls: the mean over what both have, or the percent without a position.
double FallOf(const ErrorBudget& budget, const BudgetErrors& before, const BudgetErrors& after) {
  if (budget.next_by == BudgetError::kMissing)
    return 100 * (static_cast<double>(after.mm.size()) - static_cast<double>(before.mm.size())) / budget.missing.num;
  const bool px = budget.next_by == BudgetError::kHeldOut;
  double fall = 0, count = 0;
  for (const auto& [key, distance] : px ? before.px : before.mm) {
    const double other = DistanceIn(px ? after.px : after.mm, key);
    if (std::isfinite(other)) fall += distance - other, ++count;
  }
  return count > 0 ? fall / count : 0;
}

/// Focal length over the distance from the camera to the middle of all joints.
double PxPerMm(const BudgetTruth& truth) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double count = 0, px = 0;
  for (const auto& frame : truth.people) {
    for (const auto& person : frame.second) {
      for (const auto& x : person) {
        if (x) sum += *x, ++count;
      }
    }
  }
  for (const geometry::RigCamera& camera : truth.rig.cameras)
    px += camera.camera.fx() / (camera.CenterInWorld() - sum / count).norm() / static_cast<double>(truth.rig.cameras.size());
  return px / 1000;
}

/// Mean distance of the two pixels that a ray has through both lenses, over the image.
double LensPx(const geometry::Camera& lens, const geometry::Camera& truth) {
  constexpr int kGrid = 12;
  const geometry::Projector projector(lens), exact(truth);
  double sum = 0, count = 0;
  for (int i = 0; i < kGrid * kGrid; ++i) {
    const Eigen::Vector2d px((i % kGrid + 0.5) / kGrid * truth.width_px, (i / kGrid + 0.5) / kGrid * truth.height_px);
    const geometry::Unprojection ray = exact.Unproject(px);
    if (ray.status != Status::kOk) continue;
    const geometry::Projection at = projector.Project(ray.ray_in_cam);
    if (at.status == Status::kOk) sum += (at.px - px).norm(), ++count;
  }
  return count > 0 ? sum / count : 0;
}

std::vector<BudgetCamera> DescribeCameras(const BudgetTake& take, const BudgetTruth& truth, const Substitution& solved) {
  std::vector<BudgetCamera> cameras;
  for (size_t c = 0; c < take.rig.cameras.size(); ++c) {
    const geometry::RigCamera &camera = take.rig.cameras[c], &exact = truth.rig.cameras[c];
    BudgetCamera& out = cameras.emplace_back();
    out.name = camera.camera.name;
    out.rotation_deg = RadToDeg(geometry::RotationAngle(camera.cam_from_world.rotation, exact.cam_from_world.rotation));
    out.centre_mm = 1000 * (camera.CenterInWorld() - exact.CenterInWorld()).norm();
    out.lens_px = LensPx(camera.camera, exact.camera);
    out.offset_frames = take.clocks[c].offset_frames - truth.offset_frames[c];
    solved.DescribeImages(c, &out);
  }
  return cameras;
}

void ChooseNext(ErrorBudget* budget) {
  constexpr double kMissingPercent = 2;
  double most = 0;
  const auto consider = [&](const BudgetMeasure& measure, BudgetError by, double scale) {
    for (size_t i = 0; i < kNumBudgetStages; ++i) {
      if (scale * measure.stages[i].share <= most) continue;
      most = scale * measure.stages[i].share, budget->next = kBudgetStages[i], budget->next_by = by;
    }
  };
  consider(budget->missing, BudgetError::kMissing, 1);
  if (most >= kMissingPercent) return;
  most = 0;
  consider(budget->held_out_px, BudgetError::kHeldOut, 1);
  consider(budget->joints_mm, BudgetError::kJoints, budget->px_per_mm);
}

/// Which camera of the stage matters most, and what of it.
void LookInside(const Substitution& take, const BudgetTake& given, const BudgetTruth& truth, const BudgetErrors& now,
                const RunContext& run, ErrorBudget* budget) {
  const auto stage = static_cast<size_t>(budget->next);
  for (size_t c = 0; c < given.rig.cameras.size(); ++c) {
    Truths truths = take.Sets(0);
    truths[stage][c] = true;
    budget->next_by_camera.push_back(FallOf(*budget, now, take.Solve(truths)));
  }
  if (budget->next != BudgetStage::kCalibration) return;
  const auto& gains = budget->next_by_camera;
  const auto worst = static_cast<size_t>(std::max_element(gains.begin(), gains.end()) - gains.begin());
  BudgetTake lens = given, pose = given;
  lens.rig.cameras[worst].camera = truth.rig.cameras[worst].camera;
  pose.rig.cameras[worst].cam_from_world = truth.rig.cameras[worst].cam_from_world;
  budget->lens_alone = FallOf(*budget, now, Substitution(lens, truth, run).Solve(take.Sets(0)));
  budget->pose_alone = FallOf(*budget, now, Substitution(pose, truth, run).Solve(take.Sets(0)));
}

}  // namespace

std::string_view ToString(BudgetStage stage) {
  constexpr std::array<std::string_view, kNumBudgetStages> kNames = {"calibration", "synchronisation", "2D joints",
                                                                     "association"};
  return kNames[static_cast<size_t>(stage)];
}

ErrorBudget MeasureBudget(BudgetTake take, const BudgetTruth& truth, const RunContext& run) {
  const geometry::RigDifference difference = CompareRigs(take.rig, truth.rig);
  if (difference.status == Status::kOk) take.rig = InWorld(take.rig, difference.reference_from_rig);
  internal::CentreClocks(truth, &take.clocks);
  const Substitution substitution(take, truth, run);
  std::vector<BudgetErrors> sets;
  {
    ProgressStage stage(run, "error budget", static_cast<int64_t>(kSets));
    for (size_t set = 0; set < kSets; ++set, stage.Advance()) sets.push_back(substitution.Solve(substitution.Sets(set)));
  }
  ErrorBudget budget;
  const auto mm = [](const BudgetErrors& set, int64_t key) { return DistanceIn(set.mm, key); };
  const auto px = [](const BudgetErrors& set, int64_t key) { return DistanceIn(set.px, key); };
  const auto missing = [](const BudgetErrors& set, int64_t key) { return set.mm.count(key) > 0 ? 0.0 : 100.0; };
  budget.joints_mm = MeasureShares(SumUp(substitution, sets, 0, false, mm), run.seed);
  budget.held_out_px = MeasureShares(SumUp(substitution, sets, 0, true, px), run.seed);
  budget.missing = MeasureShares(SumUp(substitution, sets, kSets - 1, false, missing), run.seed);
  budget.cameras = DescribeCameras(take, truth, substitution);
  if (budget.joints_mm.num == 0) return budget;
  budget.px_per_mm = PxPerMm(truth);
  ChooseNext(&budget);
  LookInside(substitution, take, truth, sets.front(), run, &budget);
  return budget;
}

}  // namespace mvstudio::triangulate
