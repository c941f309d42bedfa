#include "triangulate/point/robust.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "core/random.h"

namespace mvstudio::triangulate {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr size_t kMaxExhaustiveViews = 6;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

size_t RequiredViews(size_t num_views, const PointOptions& options) {
  const size_t fraction = static_cast<size_t>(std::ceil(options.min_inlier_fraction * static_cast<double>(num_views) - 1e-9));
  const size_t not_by_chance = num_views > 4 ? 3 : 2;
  return std::max({fraction, not_by_chance, static_cast<size_t>(std::max(options.min_views, 2))});
}

/// Two fits that cannot be the same point: they differ by more than `sigmas` in the metric of both.
bool Differ(const Fit& a, const Fit& b, double sigmas) {
  const Vector3d d = a.at.x_in_local - b.at.x_in_local;
  const double in_a = d.dot(a.at.information * d), in_b = d.dot(b.at.information * d);
  return std::min(in_a, in_b) > sigmas * sigmas;
}

size_t NumShared(const std::vector<View>& a, const std::vector<View>& b) {
  size_t shared = 0;
  for (const View& view : a) {
    shared += std::any_of(b.begin(), b.end(), [&](const View& o) { return o.observation_idx == view.observation_idx; });
  }
  return shared;
}

/// Two equally large sets of views that stand for two points: nobody can tell which is the right one.
bool Contradict(const Fit& a, const Fit& b, double sigmas) {
  if (a.views.size() != b.views.size() || !Differ(a, b, sigmas)) return false;
  return a.views.size() == 2 || NumShared(a.views, b.views) <= 1;
}

/// A view to first order, see WhitenedRows.
struct RayView {
  explicit RayView(const View& view) : center(view.camera->center_in_local), ray(view.ray_in_local), rows(WhitenedRows(view)) {}

  /// |r|^2 / sigma^2 to first order; infinity behind the camera.
  double Squared(const Vector3d& x_in_local) const {
    const Vector3d from_center = x_in_local - center;
    const double depth = ray.dot(from_center);
    return depth > 0 ? (rows * from_center).squaredNorm() / (depth * depth) : kInfinity;
  }

  Vector3d center, ray;
  Eigen::Matrix<double, 2, 3> rows;
};

struct RayPair {
  int i = 0, j = 0;
  bool ahead = false;      ///< the rays pass each other ahead of both cameras
  double chi_squared = 0;  ///< least sum of squares of the two views together; 0 where it cannot be had
  double cost = 0;         ///< truncated, over all views
  Vector3d x_in_local = Vector3d::Zero();
};

/// Where two rays pass each other, and by how much of their noise.
RayPair MakePair(const std::vector<RayView>& rays, int i, int j) {
  constexpr double kMinSquaredSine = 1e-26;
  const RayView &a = rays[i], &b = rays[j];
  RayPair pair;
  pair.i = i, pair.j = j;
  const Vector3d normal = a.ray.cross(b.ray), baseline = b.center - a.center;
  const double sine_squared = normal.squaredNorm();
  if (!(sine_squared > kMinSquaredSine)) return pair;
  const double depth_a = baseline.cross(b.ray).dot(normal) / sine_squared;
  const double depth_b = baseline.cross(a.ray).dot(normal) / sine_squared;
  pair.ahead = depth_a > 0 && depth_b > 0;
  // Whitened residuals of a metre along the normal, times |normal|; the best point between the rays weighs them.
  const double a2 = (a.rows * normal).squaredNorm() / (depth_a * depth_a);
  const double b2 = (b.rows * normal).squaredNorm() / (depth_b * depth_b);
  const double gap = baseline.dot(normal) / sine_squared, share = a2 / (a2 + b2);
  if (!std::isfinite(share)) return pair;
  pair.chi_squared = gap * gap * b2 * share;
  pair.x_in_local = share * (a.center + depth_a * a.ray) + (1 - share) * (b.center + depth_b * b.ray);
  return pair;
}

/// Both views within the limit of one point need a sum of squares of at most twice its square; another factor of two is left
/// to what the first order leaves out.
bool Compatible(const RayPair& pair, const PointOptions& options) {
  return !(pair.chi_squared > 4 * options.max_residual_sigmas * options.max_residual_sigmas);
}

std::vector<RayPair> Pairs(const std::vector<RayView>& rays, const PointOptions& options) {
  std::vector<RayPair> pairs;
  const int n = static_cast<int>(rays.size());
  const int64_t count = static_cast<int64_t>(n) * (n - 1) / 2;
  const int64_t limit = rays.size() <= kMaxExhaustiveViews ? count : std::max(options.max_hypotheses, 1);
  pairs.reserve(static_cast<size_t>(std::min(count, limit)));
  if (count <= limit) {
    for (int i = 0; i < n; ++i) {
      for (int j = i + 1; j < n; ++j) pairs.push_back(MakePair(rays, i, j));
    }
    return pairs;
  }
  Rng rng(options.seed);
  for (int64_t k = 0; k < limit; ++k) {
    const int i = static_cast<int>(rng.Index(n)), j = static_cast<int>((i + 1 + rng.Index(n - 1)) % n);
    pairs.push_back(MakePair(rays, i, j));
  }
  return pairs;
}

/// What the search knows of the views before any fit.
struct Evidence {
  Evidence(const std::vector<View>& views, const PointOptions& options)
      : rays(views.begin(), views.end()), pairs(Pairs(rays, options)) {
    for (const RayPair& pair : pairs) all_compatible = all_compatible && Compatible(pair, options);
  }

  std::vector<RayView> rays;
  std::vector<RayPair> pairs;
  bool all_compatible = true;
};

/// Best consistent set of a given size, by chi squared; kOutlier when another one contradicts it. `excludes[i]` has the bits
/// of the views that cannot be in one set with i.
Fit BestOfSize(const std::vector<View>& views, const std::vector<unsigned>& excludes, int size, const PointOptions& options) {
  Fit best;
  std::vector<Fit> consistent;
  std::vector<View> chosen;
  for (unsigned mask = 1; mask < 1u << views.size(); ++mask) {
    if (__builtin_popcount(mask) != size) continue;
    unsigned excluded = 0;
    chosen.clear();
    for (size_t i = 0; i < views.size(); ++i) {
      if (!(mask >> i & 1u)) continue;
      excluded |= excludes[i];
      chosen.push_back(views[i]);
    }
    if (excluded & mask) continue;
    Fit fit = FitViews(chosen, options);
    if (fit.status != Status::kOk || fit.at.worst_sigmas > options.max_residual_sigmas) continue;
    consistent.push_back(fit);
    if (best.status != Status::kOk || fit.at.chi_squared < best.at.chi_squared) best = std::move(fit);
  }
  for (const Fit& other : consistent) {
    if (Contradict(best, other, options.max_residual_sigmas)) return {};
  }
  return best;
}

Fit SelectExhaustive(const std::vector<View>& views, const Evidence& evidence, size_t required, const PointOptions& options) {
  std::vector<unsigned> excludes(views.size(), 0);
  for (const RayPair& pair : evidence.pairs) {
    if (Compatible(pair, options)) continue;
    excludes[pair.i] |= 1u << pair.j;
    excludes[pair.j] |= 1u << pair.i;
  }
  for (size_t size = views.size() - 1; size >= required; --size) {
    Fit best = BestOfSize(views, excludes, static_cast<int>(size), options);
    if (best.status == Status::kOk) return best;
  }
  return {};
}

double TruncatedCost(const std::vector<RayView>& rays, const Vector3d& x_in_local, double squared_limit) {
  double cost = 0;
  for (const RayView& ray : rays) cost += std::min(ray.Squared(x_in_local), squared_limit);
  return cost;
}

double ExactTruncatedCost(const std::vector<View>& views, const Vector3d& x_in_local, double limit) {
  double cost = 0;
  for (const View& view : views) {
    const double residual = std::min(WhitenedResidual(view, x_in_local), limit);
    cost += residual * residual;
  }
  return cost;
}

size_t NumNear(const std::vector<RayView>& rays, const Vector3d& x_in_local, double limit) {
  size_t count = 0;
  for (const RayView& ray : rays) count += ray.Squared(x_in_local) <= limit * limit;
  return count;
}

std::vector<View> Near(const std::vector<View>& views, const std::vector<RayView>& rays, const Vector3d& x_in_local,
                       double limit) {
  std::vector<View> near;
  near.reserve(views.size());
  for (size_t i = 0; i < views.size(); ++i) {
    if (rays[i].Squared(x_in_local) <= limit * limit) near.push_back(views[i]);
  }
  return near;
}

std::vector<View> Inliers(const std::vector<View>& views, const Vector3d& x_in_local, double limit) {
  std::vector<View> inliers;
  inliers.reserve(views.size());
  for (const View& view : views) {
    if (WhitenedResidual(view, x_in_local) <= limit) inliers.push_back(view);
  }
  return inliers;
}

bool SameViews(const std::vector<View>& a, const std::vector<View>& b) {
  return a.size() == b.size() && std::equal(a.begin(), a.end(), b.begin(), [](const View& u, const View& v) {
           return u.observation_idx == v.observation_idx;
         });
}

/// Fits to the views near the hypothesis, then to the fit's own inliers until they no longer change.
Fit LocallyOptimize(const std::vector<View>& views, const std::vector<RayView>& rays, const Vector3d& x_in_local,
                    const PointOptions& options) {
  // Pairs are noisy: a wider limit keeps the views that a refit will bring inside.
  std::vector<View> chosen = Near(views, rays, x_in_local, 2 * options.max_residual_sigmas);
  Fit fit = chosen.size() < 2 ? Fit{} : FitViews(chosen, options);
  if (fit.status != Status::kOk) {
    chosen = Inliers(views, x_in_local, options.max_residual_sigmas);
    if (chosen.size() < 2) return {};
    fit = FitViews(chosen, options);
  }
  for (int round = 0; round < 10 && fit.status == Status::kOk; ++round) {
    std::vector<View> next = Inliers(views, fit.at.x_in_local, options.max_residual_sigmas);
    if (SameViews(next, chosen)) return fit;
    if (next.size() < 2) return {};
    chosen = std::move(next);
    fit = FitViews(chosen, options);
  }
  return {};
}

/// Pairs that could stand for the point, best first.
std::vector<RayPair> RankedHypotheses(const Evidence& evidence, const PointOptions& options) {
  const double limit = 2 * options.max_residual_sigmas;
  std::vector<RayPair> ranked;
  ranked.reserve(evidence.pairs.size());
  for (const RayPair& pair : evidence.pairs) {
    if (!pair.ahead || !Compatible(pair, options)) continue;
    ranked.push_back(pair);
    ranked.back().cost = TruncatedCost(evidence.rays, pair.x_in_local, limit * limit);
  }
  std::stable_sort(ranked.begin(), ranked.end(), [](const RayPair& a, const RayPair& b) { return a.cost < b.cost; });
  return ranked;
}

Fit SelectFromPairs(const std::vector<View>& views, const Evidence& evidence, size_t required, const PointOptions& options) {
  constexpr int kMaxFits = 20;
  Fit best;
  double best_cost = kInfinity;
  bool contradicted = false;
  int num_fits = 0;
  std::vector<bool> covered(views.size(), false);  // by the best fit
  for (const RayPair& pair : RankedHypotheses(evidence, options)) {
    if (covered[pair.i] && covered[pair.j]) continue;
    const size_t support = NumNear(evidence.rays, pair.x_in_local, 2 * options.max_residual_sigmas);
    if (support < std::max(required, best.views.size())) continue;
    if (++num_fits > kMaxFits) break;
    Fit fit = LocallyOptimize(views, evidence.rays, pair.x_in_local, options);
    if (fit.status != Status::kOk || fit.views.size() < required) continue;
    const double cost = ExactTruncatedCost(views, fit.at.x_in_local, options.max_residual_sigmas);
    const bool conflict = best.status == Status::kOk && Contradict(best, fit, options.max_residual_sigmas);
    if (cost < best_cost) {
      contradicted = conflict || (contradicted && fit.views.size() == best.views.size());
      best_cost = cost;
      best = std::move(fit);
      for (size_t i = 0; i < views.size(); ++i) {
        covered[i] = WhitenedResidual(views[i], best.at.x_in_local) <= options.max_residual_sigmas;
      }
    } else {
      contradicted |= conflict;
    }
  }
  return contradicted ? Fit{} : best;
}

}  // namespace

Fit FitConsistent(const std::vector<View>& views, const PointOptions& options) {
  std::optional<Evidence> evidence;
  // A start far off some view: two rays that cannot meet spare the fit to all views.
  const LinearPoint start = QuickStart(views);
  if (start.status == Status::kOk && WorstResidual(views, start.x_in_local) > 3 * options.max_residual_sigmas) {
    evidence.emplace(views, options);
  }
  Fit all;
  const bool tried = !evidence || evidence->all_compatible;
  if (tried) {
    all = FitViews(views, options);
    if (all.status == Status::kOk && all.at.worst_sigmas <= options.max_residual_sigmas) return all;
  }
  const size_t required = RequiredViews(views.size(), options);
  if (views.size() > required) {
    if (!evidence) evidence.emplace(views, options);
    Fit best = views.size() <= kMaxExhaustiveViews ? SelectExhaustive(views, *evidence, required, options)
                                                   : SelectFromPairs(views, *evidence, required, options);
    if (best.status == Status::kOk) return best;
  }
  // No set agrees: what all views together say is the reason, e.g. that the rays are parallel.
  if (!tried) all = FitViews(views, options);
  if (all.status == Status::kOk) all.status = Status::kOutlier;
  return all;
}

}  // namespace mvstudio::triangulate
