#include "triangulate/point/holdout.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>

#include "core/check.h"
#include "core/choice/heldout_choice.h"
#include "core/format.h"
#include "core/parallel.h"
#include "core/random.h"
#include "core/statistics.h"

namespace mvstudio::triangulate {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr int kDraws = 200;
constexpr int kMaxBlocks = 25;
constexpr size_t kMaxLeftOut = 32;  // of a point

int Original(const PreparedRig& rig, int camera_idx) {
  const int of = rig.duplicate_of[static_cast<size_t>(camera_idx)];
  return of < 0 ? camera_idx : of;
}

bool Usable(const Observation& seen) { return seen.px.allFinite() && std::isfinite(seen.sigma_px) && seen.sigma_px > 0; }

/// Cameras that differ, copies counted once.
size_t NumCameras(const PreparedRig& rig, const std::vector<Observation>& observations) {
  std::vector<int> cameras;
  for (const Observation& seen : observations) {
    if (Usable(seen)) cameras.push_back(Original(rig, seen.camera_idx));
  }
  std::sort(cameras.begin(), cameras.end());
  return static_cast<size_t>(std::unique(cameras.begin(), cameras.end()) - cameras.begin());
}

/// The first detection of a point that is left out, of every `stride`-th: `stride` points in a row take all of them in turn, in
/// an order that repeats itself with nothing, as joints do from frame to frame.
size_t FirstLeftOut(size_t point, size_t stride) {
  const uint64_t shift = (static_cast<uint64_t>(point / stride) * 0x9e3779b97f4a7c15u) >> 40;
  return (point + shift) % stride;
}

std::vector<LeftOutSample> LeaveOutOf(const PreparedRig& rig, const std::vector<Observation>& observations, size_t point,
                                      const PointSolver& solve) {
  std::vector<LeftOutSample> samples;
  const size_t stride = std::max<size_t>(1, (observations.size() + kMaxLeftOut - 1) / kMaxLeftOut);
  for (size_t i = FirstLeftOut(point, stride); i < observations.size(); i += stride) {
    if (!IsLeftOutSample(rig, observations, i)) continue;
    const Point others = solve(WithoutCamera(rig, observations, observations[i].camera_idx));
    samples.push_back(PredictLeftOut(rig, observations[i], others, point));
  }
  return samples;
}

double Error(const LeftOutSample& sample) { return sample.status == Status::kOk ? sample.residual_px.norm() : kInfinity; }

/// Block of each frame: consecutive frames, as equal in number as can be.
std::vector<int> BlockOfPoint(const std::vector<PointLabel>& labels) {
  std::map<int, int> rank;
  for (const PointLabel& label : labels) rank[label.frame] = 0;
  const int frames = static_cast<int>(rank.size()), blocks = std::min(kMaxBlocks, frames);
  int next = 0;
  for (auto& [frame, block] : rank) block = static_cast<int>(static_cast<int64_t>(next++) * blocks / frames);
  std::vector<int> of_point;
  of_point.reserve(labels.size());
  for (const PointLabel& label : labels) of_point.push_back(rank[label.frame]);
  return of_point;
}

/// How often each block is drawn, one row a draw; the same for every figure so that differences are paired.
std::vector<std::vector<int>> DrawBlocks(int num_blocks) {
  Rng rng(20240229);
  std::vector<std::vector<int>> draws(kDraws, std::vector<int>(static_cast<size_t>(num_blocks), 0));
  for (auto& draw : draws) {
    for (int k = 0; k < num_blocks; ++k) ++draw[static_cast<size_t>(rng.Index(num_blocks))];
  }
  return draws;
}

/// Errors in ascending order with the block of each.
struct SortedErrors {
  std::vector<double> px;
  std::vector<int> block;
};

SortedErrors Sort(const std::vector<double>& errors, const std::vector<int>& blocks) {
  std::vector<size_t> order(errors.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::stable_sort(order.begin(), order.end(), [&errors](size_t a, size_t b) { return errors[a] < errors[b]; });
  SortedErrors sorted;
  for (const size_t i : order) sorted.px.push_back(errors[i]), sorted.block.push_back(blocks[i]);
  return sorted;
}

/// Quantile of a bootstrap draw: the smallest error with at least the fraction `q` of the weight at or below it.
double DrawnQuantile(const SortedErrors& sorted, const std::vector<int>& draw, double q) {
  int64_t total = 0;
  for (const int block : sorted.block) total += draw[static_cast<size_t>(block)];
  const double wanted = q * static_cast<double>(total);
  int64_t sum = 0;
  for (size_t i = 0; i < sorted.px.size(); ++i) {
    sum += draw[static_cast<size_t>(sorted.block[i])];
    if (sum > 0 && static_cast<double>(sum) >= wanted) return sorted.px[i];
  }
  return std::nan("");
}

/// Standard deviation of the finite values; infinite when fewer than half are.
double Spread(const std::vector<double>& values) {
  const std::vector<double> finite = FiniteValues(values);
  return 2 * finite.size() < values.size() || finite.size() < 2 ? kInfinity : SampleDeviation(finite);
}

int NumBlocks(const std::vector<int>& blocks) {
  return blocks.empty() ? 0 : *std::max_element(blocks.begin(), blocks.end()) + 1;
}

struct Selected {
  std::vector<double> errors;
  std::vector<int> blocks;
  std::vector<double> predicted, sigmas;
};

LeftOutFigures Figures(Selected selected, const std::vector<std::vector<int>>& draws) {
  LeftOutFigures figures;
  figures.num_samples = static_cast<int>(selected.errors.size());
  figures.num_predicted = static_cast<int>(selected.predicted.size());
  const SortedErrors sorted = Sort(selected.errors, selected.blocks);
  figures.median_px = LinearQuantile(sorted.px, 0.5);
  figures.p90_px = LinearQuantile(sorted.px, 0.9);
  std::vector<double> medians;
  for (const auto& draw : draws) medians.push_back(DrawnQuantile(sorted, draw, 0.5));
  figures.median_error_px = sorted.px.empty() ? std::nan("") : Spread(medians);
  std::sort(selected.predicted.begin(), selected.predicted.end());  // their sum begins with the small ones
  figures.predicted_median_px = LinearQuantile(selected.predicted, 0.5);
  figures.predicted_p90_px = LinearQuantile(selected.predicted, 0.9);
  figures.median_sigmas = LinearQuantile(selected.sigmas, 0.5);
  figures.coverage = figures.num_samples == 0 ? std::nan("") : static_cast<double>(figures.num_predicted) / figures.num_samples;
  figures.predicted_mean_px = Mean(selected.predicted);
  return figures;
}

void Add(const LeftOutSample& sample, int block, Selected* selected) {
  selected->errors.push_back(Error(sample));
  selected->blocks.push_back(block);
  if (sample.status != Status::kOk) return;
  selected->predicted.push_back(sample.residual_px.norm());
  selected->sigmas.push_back(std::sqrt(sample.residual_px.dot(sample.covariance_px2.inverse() * sample.residual_px)));
}

/// b - a, where infinity minus infinity is no difference.
double Difference(double a, double b) { return a == b ? 0.0 : b - a; }

PairedDifference Paired(const std::vector<double>& a, const std::vector<double>& b, const std::vector<int>& blocks,
                        const std::vector<std::vector<int>>& draws) {
  PairedDifference difference;
  difference.num_samples = static_cast<int>(a.size());
  const SortedErrors in_a = Sort(a, blocks), in_b = Sort(b, blocks);
  const auto measure = [&](double q, double* value, double* error) {
    std::vector<double> drawn;
    for (const auto& draw : draws) drawn.push_back(Difference(DrawnQuantile(in_a, draw, q), DrawnQuantile(in_b, draw, q)));
    *value = Difference(LinearQuantile(in_a.px, q), LinearQuantile(in_b.px, q));
    *error = Spread(drawn);
  };
  measure(0.5, &difference.median_px, &difference.median_error_px);
  measure(0.9, &difference.p90_px, &difference.p90_error_px);
  return difference;
}

void CheckSameSamples(const std::vector<LeftOutSample>& a, const std::vector<LeftOutSample>& b) {
  MVS_CHECK(a.size() == b.size(), a.size() << " samples against " << b.size());
  for (size_t i = 0; i < a.size(); ++i) {
    MVS_CHECK(a[i].point == b[i].point && a[i].camera_idx == b[i].camera_idx, "sample " << i << " is of another detection");
  }
}

/// Indices of points that may have samples, evenly thinned.
std::vector<size_t> ChoosePoints(const std::vector<std::vector<Observation>>& points, size_t max_points) {
  std::vector<size_t> usable, chosen;
  for (size_t i = 0; i < points.size(); ++i) {
    if (points[i].size() >= 3) usable.push_back(i);
  }
  const size_t count = std::min(usable.size(), max_points);
  for (size_t k = 0; k < count; ++k) chosen.push_back(usable[k * usable.size() / count]);
  return chosen;
}

bool WithinOneError(const PairedDifference& d, double tolerance_px) {
  HeldOutRule rule;
  rule.absolute = tolerance_px, rule.min_units = 0;  // their number was asked for before
  return IsAsGood({d.median_px, d.median_error_px, d.num_samples}, rule) &&
         IsAsGood({d.p90_px, d.p90_error_px, d.num_samples}, rule);
}

std::string Reason(const MethodChoice& choice) {
  const MethodScore& chosen = choice.scores[choice.chosen];
  const MethodScore& best = choice.scores[choice.best];
  if (choice.status != Status::kOk) {
    return Format("%s: only %d detections are seen by three cameras or more, too few to choose by", chosen.name.c_str(),
                  best.figures.num_samples);
  }
  if (choice.chosen == choice.best) {
    return Format("%s: held-out median %.3f +- %.3f px, and nothing cheaper is as good", chosen.name.c_str(),
                  chosen.figures.median_px, chosen.figures.median_error_px);
  }
  return Format("%s: held-out median %.3f px, within %.3f px of the best (%s) at less cost", chosen.name.c_str(),
                chosen.figures.median_px, std::max(chosen.from_best.median_px, 0.0), best.name.c_str());
}

/// Marks the samples that any of the candidates predicts.
std::vector<size_t> AnyPredicts(const std::vector<std::vector<LeftOutSample>>& runs) {
  std::vector<size_t> common;
  for (size_t i = 0; i < runs[0].size(); ++i) {
    if (std::any_of(runs.begin(), runs.end(), [i](const auto& run) { return run[i].status == Status::kOk; }))
      common.push_back(i);
  }
  return common;
}

}  // namespace

std::vector<Observation> WithoutCamera(const PreparedRig& rig, const std::vector<Observation>& observations, int camera_idx) {
  std::vector<Observation> others;
  for (const Observation& other : observations) {
    if (Original(rig, other.camera_idx) != Original(rig, camera_idx)) others.push_back(other);
  }
  return others;
}

bool IsLeftOutSample(const PreparedRig& rig, const std::vector<Observation>& observations, size_t i) {
  return Usable(observations[i]) && NumCameras(rig, WithoutCamera(rig, observations, observations[i].camera_idx)) >= 2;
}

LeftOutSample PredictLeftOut(const PreparedRig& rig, const Observation& seen, const Point& point, size_t point_idx) {
  LeftOutSample sample;
  sample.point = point_idx;
  sample.camera_idx = seen.camera_idx;
  sample.status = point.status;
  if (point.status != Status::kOk) return sample;
  const PreparedCamera& camera = rig.cameras[static_cast<size_t>(seen.camera_idx)];
  const auto at = camera.projector.ProjectWithJacobians(camera.ToCam(point.x_in_world - rig.origin_in_world));
  sample.status = at.status == Status::kOk && !at.px.allFinite() ? Status::kOutsideValidRadius : at.status;
  if (sample.status != Status::kOk) return sample;
  const Eigen::Matrix<double, 2, 3> px_from_world = at.d_px_d_x * camera.cam_from_local_rotation;
  sample.residual_px = seen.px - at.px;
  sample.covariance_px2 = px_from_world * point.covariance * px_from_world.transpose();
  sample.covariance_px2.diagonal().array() += seen.sigma_px * seen.sigma_px;
  sample.sigma_px = std::sqrt(0.5 * sample.covariance_px2.trace());
  return sample;
}

std::vector<LeftOutSample> LeaveOneCameraOut(const PreparedRig& rig, const std::vector<std::vector<Observation>>& points,
                                             const PointSolver& solve, int num_threads) {
  constexpr int64_t kBlock = 64;
  const int64_t count = static_cast<int64_t>(points.size());
  std::vector<std::vector<LeftOutSample>> of_point(points.size());
  ParallelFor((count + kBlock - 1) / kBlock, num_threads, [&](int64_t block) {
    for (int64_t i = block * kBlock; i < std::min(count, (block + 1) * kBlock); ++i) {
      of_point[static_cast<size_t>(i)] = LeaveOutOf(rig, points[static_cast<size_t>(i)], static_cast<size_t>(i), solve);
    }
  });
  std::vector<LeftOutSample> samples;
  for (const auto& each : of_point) samples.insert(samples.end(), each.begin(), each.end());
  return samples;
}

LeftOutSummary SummarizeLeftOut(const PreparedRig& rig, const std::vector<LeftOutSample>& samples,
                                const std::vector<PointLabel>& labels) {
  const std::vector<int> blocks = BlockOfPoint(labels);
  const auto draws = DrawBlocks(NumBlocks(blocks));
  int num_joints = 0;
  for (const PointLabel& label : labels) num_joints = std::max(num_joints, label.joint_idx + 1);
  Selected all;
  std::vector<Selected> cameras(rig.cameras.size()), joints(static_cast<size_t>(num_joints));
  for (const LeftOutSample& sample : samples) {
    MVS_CHECK(sample.point < labels.size(), "point " << sample.point << " has no label");
    const int block = blocks[sample.point];
    Add(sample, block, &all);
    Add(sample, block, &cameras[static_cast<size_t>(sample.camera_idx)]);
    Add(sample, block, &joints[static_cast<size_t>(labels[sample.point].joint_idx)]);
  }
  LeftOutSummary summary{Figures(std::move(all), draws), {}, {}};
  for (Selected& each : cameras) summary.cameras.push_back(Figures(std::move(each), draws));
  for (Selected& each : joints) summary.joints.push_back(Figures(std::move(each), draws));
  return summary;
}

PairedDifference CompareLeftOut(const std::vector<LeftOutSample>& a, const std::vector<LeftOutSample>& b,
                                const std::vector<PointLabel>& labels) {
  CheckSameSamples(a, b);
  const std::vector<int> blocks = BlockOfPoint(labels);
  std::vector<double> in_a, in_b;
  std::vector<int> of_sample;
  for (size_t i = 0; i < a.size(); ++i) {
    if (a[i].status != Status::kOk && b[i].status != Status::kOk) continue;
    in_a.push_back(Error(a[i])), in_b.push_back(Error(b[i])), of_sample.push_back(blocks[a[i].point]);
  }
  return Paired(in_a, in_b, of_sample, DrawBlocks(NumBlocks(blocks)));
}

MethodChoice ChooseMethod(const PreparedRig& rig, const std::vector<std::vector<Observation>>& points,
                          const std::vector<PointLabel>& labels, const std::vector<MethodCandidate>& candidates,
                          const MethodChoiceOptions& options, int num_threads) {
  MVS_CHECK(!candidates.empty(), "nothing to choose from");
  MVS_CHECK(points.size() == labels.size(), points.size() << " points, " << labels.size() << " labels");
  std::vector<std::vector<Observation>> tried;
  std::vector<PointLabel> tried_labels;
  for (const size_t i : ChoosePoints(points, static_cast<size_t>(options.max_points))) {
    tried.push_back(points[i]), tried_labels.push_back(labels[i]);
  }
  std::vector<std::vector<LeftOutSample>> runs;
  for (const MethodCandidate& each : candidates) runs.push_back(LeaveOneCameraOut(rig, tried, each.solve, num_threads));

  const std::vector<int> blocks = BlockOfPoint(tried_labels);
  const auto draws = DrawBlocks(NumBlocks(blocks));
  const std::vector<size_t> common = AnyPredicts(runs);
  MethodChoice choice;
  std::vector<std::vector<double>> errors;
  std::vector<int> common_blocks;
  for (const size_t i : common) common_blocks.push_back(blocks[runs[0][i].point]);
  for (size_t m = 0; m < candidates.size(); ++m) {
    Selected selected;
    for (const size_t i : common) Add(runs[m][i], blocks[runs[m][i].point], &selected);
    errors.push_back(selected.errors);
    choice.scores.push_back({candidates[m].name, candidates[m].cost, Figures(std::move(selected), draws), {}, false});
    if (choice.scores[m].figures.median_px < choice.scores[choice.best].figures.median_px) choice.best = m;
  }
  const bool enough = static_cast<int>(common.size()) >= options.min_samples;
  choice.status = enough ? Status::kOk : Status::kTooFewViews;
  choice.chosen = enough ? choice.best : 0;
  for (size_t m = 0; enough && m < candidates.size(); ++m) {
    MethodScore& score = choice.scores[m];
    score.from_best = Paired(errors[choice.best], errors[m], common_blocks, draws);
    score.justified = WithinOneError(score.from_best, options.tolerance * choice.scores[choice.best].figures.median_px);
    if (score.justified && score.cost < candidates[choice.chosen].cost) choice.chosen = m;
  }
  choice.reason = Reason(choice);
  return choice;
}

}  // namespace mvstudio::triangulate
