#include "triangulate/robust.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/random.h"
#include "triangulate/linear.h"

namespace mvstudio::triangulate {
namespace {

constexpr size_t kMaxExhaustiveViews = 6;

size_t RequiredViews(size_t num_views, const PointOptions& options) {
  const size_t fraction = static_cast<size_t>(std::ceil(options.min_inlier_fraction * static_cast<double>(num_views) - 1e-9));
  const size_t not_by_chance = num_views > 4 ? 3 : 2;
  return std::max({fraction, not_by_chance, static_cast<size_t>(std::max(options.min_views, 2))});
}

std::vector<View> Subset(const std::vector<View>& views, unsigned mask) {
  std::vector<View> subset;
  for (size_t i = 0; i < views.size(); ++i) {
    if (mask >> i & 1u) subset.push_back(views[i]);
  }
  return subset;
}

/// Two fits that cannot be the same point: they differ by more than `sigmas` in the metric of both.
bool Differ(const Fit& a, const Fit& b, double sigmas) {
  const Eigen::Vector3d d = a.at.x_in_local - b.at.x_in_local;
  const double in_a = d.dot(a.at.information * d), in_b = d.dot(b.at.information * d);
  return std::min(in_a, in_b) > sigmas * sigmas;
}

/// Best consistent subset of a given size, by chi squared; with two views, kOutlier when another pair agrees elsewhere.
Fit BestOfSize(const std::vector<View>& views, int size, const PointOptions& options) {
  Fit best;
  std::vector<Fit> consistent;
  for (unsigned mask = 1; mask < 1u << views.size(); ++mask) {
    if (__builtin_popcount(mask) != size) continue;
    Fit fit = FitViews(Subset(views, mask), options);
    if (fit.status != Status::kOk || fit.worst_sigmas > options.max_residual_sigmas) continue;
    if (size == 2) consistent.push_back(fit);
    if (best.status != Status::kOk || fit.at.chi_squared < best.at.chi_squared) best = std::move(fit);
  }
  for (const Fit& other : consistent) {
    if (Differ(best, other, options.max_residual_sigmas)) return {};
  }
  return best;
}

Fit SelectExhaustive(const std::vector<View>& views, size_t required, const PointOptions& options) {
  for (size_t size = views.size() - 1; size >= required; --size) {
    Fit best = BestOfSize(views, static_cast<int>(size), options);
    if (best.status == Status::kOk) return best;
  }
  return {};
}

/// Truncated sum of squares (MSAC, Torr and Zisserman 2000).
double TruncatedCost(const std::vector<View>& views, const Eigen::Vector3d& x_in_local, double limit, double give_up) {
  double cost = 0;
  for (const View& view : views) {
    const double residual = std::min(WhitenedResidual(view, x_in_local), limit);
    cost += residual * residual;
    if (cost >= give_up) break;
  }
  return cost;
}

std::vector<View> Inliers(const std::vector<View>& views, const Eigen::Vector3d& x_in_local, double limit) {
  std::vector<View> inliers;
  for (const View& view : views) {
    if (WhitenedResidual(view, x_in_local) <= limit) inliers.push_back(view);
  }
  return inliers;
}

/// Refits to its own inliers until they no longer change.
Fit LocallyOptimize(const std::vector<View>& views, Eigen::Vector3d x_in_local, const PointOptions& options) {
  std::vector<View> inliers = Inliers(views, x_in_local, options.max_residual_sigmas);
  for (int round = 0; round < 10 && inliers.size() >= 2; ++round) {
    Fit fit = FitViews(inliers, options);
    if (fit.status != Status::kOk) return fit;
    std::vector<View> next = Inliers(views, fit.at.x_in_local, options.max_residual_sigmas);
    const bool same = next.size() == inliers.size() &&
                      std::equal(next.begin(), next.end(), inliers.begin(),
                                 [](const View& a, const View& b) { return a.observation_idx == b.observation_idx; });
    if (same) return fit;
    inliers = std::move(next);
  }
  return {};
}

std::vector<std::pair<size_t, size_t>> Pairs(size_t num_views, const PointOptions& options) {
  std::vector<std::pair<size_t, size_t>> pairs;
  const size_t count = num_views * (num_views - 1) / 2;
  if (count <= static_cast<size_t>(options.max_hypotheses)) {
    for (size_t i = 0; i < num_views; ++i) {
      for (size_t j = i + 1; j < num_views; ++j) pairs.emplace_back(i, j);
    }
    return pairs;
  }
  Rng rng(options.seed);
  const int64_t n = static_cast<int64_t>(num_views);
  for (int k = 0; k < options.max_hypotheses; ++k) {
    const int64_t i = rng.Index(n), j = (i + 1 + rng.Index(n - 1)) % n;
    pairs.emplace_back(i, j);
  }
  return pairs;
}

Fit SelectFromPairs(const std::vector<View>& views, size_t required, const PointOptions& options) {
  Fit best;
  double best_hypothesis = std::numeric_limits<double>::infinity(), best_cost = best_hypothesis;
  for (const auto& [i, j] : Pairs(views.size(), options)) {
    const LinearPoint start = TwoViewMidpoint(views[i], views[j]);
    if (start.status != Status::kOk) continue;
    // Pairs are noisy: a wider limit keeps the views that a refit will bring inside.
    const double limit = 2 * options.max_residual_sigmas;
    const double cost = TruncatedCost(views, start.x_in_local, limit, best_hypothesis);
    if (!(cost < best_hypothesis)) continue;
    best_hypothesis = cost;
    const std::vector<View> near = Inliers(views, start.x_in_local, limit);
    const Fit coarse = near.size() < 2 ? Fit{} : FitViews(near, options);
    Fit fit = LocallyOptimize(views, coarse.status == Status::kOk ? coarse.at.x_in_local : start.x_in_local, options);
    if (fit.status != Status::kOk || fit.views.size() < required) continue;
    const double fit_cost = TruncatedCost(views, fit.at.x_in_local, options.max_residual_sigmas, best_cost);
    if (fit_cost < best_cost) {
      best_cost = fit_cost;
      best = std::move(fit);
    }
  }
  return best;
}

/// Distance to the nearest of the cameras and the largest distance of two of them.
void Extent(const std::vector<View>& views, const Eigen::Vector3d& x_in_local, double* nearest, double* baseline) {
  *nearest = std::numeric_limits<double>::infinity();
  *baseline = 0;
  for (const View& view : views) {
    *nearest = std::min(*nearest, (x_in_local - view.camera->center_in_local).norm());
    *baseline = std::max(*baseline, (view.camera->center_in_local - views.front().camera->center_in_local).norm());
  }
}

/// Where a camera stands it sees nothing.
bool AtACentre(const std::vector<View>& views, const Eigen::Vector3d& x_in_local) {
  double nearest = 0, baseline = 0;
  Extent(views, x_in_local, &nearest, &baseline);
  return !(nearest > 1e-6 * baseline);
}

/// Checks of a refined point, in units of its own uncertainty.
Status CheckGeometry(const std::vector<View>& views, const Refinement& at, const PointOptions& options) {
  double nearest = 0, baseline = 0;
  Extent(views, at.x_in_local, &nearest, &baseline);
  if (AtACentre(views, at.x_in_local)) return Status::kDegenerate;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(at.information, Eigen::EigenvaluesOnly);
  const double weakest = eigen.eigenvalues()[0];
  if (!(weakest > 1e-14 * eigen.eigenvalues()[2])) return Status::kLowParallax;
  const double sigma = 1 / std::sqrt(weakest);
  if (sigma * options.min_parallax_sigmas > nearest) return Status::kLowParallax;
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

Refinement RunMethod(const std::vector<View>& views, const PointOptions& options) {
  const bool midpoint = options.method == PointMethod::kMidpoint;
  const LinearPoint start = midpoint ? Midpoint(views) : WeightedLinear(views);
  if (start.status != Status::kOk) return {start.status, {}, {}, 0};
  if (AtACentre(views, start.x_in_local)) return {Status::kDegenerate, {}, {}, 0};
  if (midpoint || options.method == PointMethod::kLinear) return Evaluate(views, start.x_in_local);
  return Refine(views, start.x_in_local);
}

}  // namespace

Fit FitViews(const std::vector<View>& views, const PointOptions& options) {
  Fit fit;
  fit.views = views;
  fit.status = Status::kDegenerate;
  if (HaveOneCentre(views)) return fit;
  fit.at = RunMethod(views, options);
  const bool usable = fit.at.status == Status::kOk || fit.at.status == Status::kNotConverged;
  fit.status = usable ? CheckGeometry(views, fit.at, options) : ExplainFailure(views, fit.at.status, options);
  if (fit.status != Status::kOk) return fit;
  for (const View& view : views) fit.worst_sigmas = std::max(fit.worst_sigmas, WhitenedResidual(view, fit.at.x_in_local));
  return fit;
}

Fit SelectConsistent(const std::vector<View>& views, const Fit& all, const PointOptions& options) {
  const size_t required = RequiredViews(views.size(), options);
  if (views.size() <= required) {
    Fit none = all;
    if (none.status == Status::kOk) none.status = Status::kOutlier;
    return none;
  }
  Fit best = views.size() <= kMaxExhaustiveViews ? SelectExhaustive(views, required, options)
                                                 : SelectFromPairs(views, required, options);
  // No subset agrees: what all views together say is the reason, e.g. that the rays are parallel.
  if (best.status != Status::kOk) best.status = all.status == Status::kOk ? Status::kOutlier : all.status;
  return best;
}

}  // namespace mvstudio::triangulate
