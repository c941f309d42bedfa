#include "calib/lens/model_selection.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>
#include <optional>

#include "calib/bundle/camera_noise.h"
#include "calib/bundle/view_clusters.h"
#include "calib/covariance/uncertainty.h"
#include "calib/lens/evidence.h"
#include "calib/lens/lens_configs.h"
#include "core/choice/heldout_choice.h"
#include "core/format.h"
#include "core/parallel.h"

namespace mvstudio::calib {
namespace {

using geometry::LensModel;

constexpr int kMinClusters = 6, kMinClustersOfCamera = 3;
constexpr int kManyCorners = 5000, kFewFolds = 3;  // large problems lose little by fewer folds
constexpr double kCapOfMedian = 6;                 // errors count as at most so many medians of the best candidate

/// Smallest median over the candidates, per camera.
std::vector<double> BestMedians(const std::vector<LensCandidate>& candidates, int num_cameras) {
  std::vector<double> best(num_cameras, std::numeric_limits<double>::infinity());
  for (const LensCandidate& candidate : candidates) {
    for (int c = 0; c < num_cameras; ++c) {
      const double median = Summarize(candidate.fit, candidate.holdout, c).median_px;
      if (std::isfinite(median)) best[c] = std::min(best[c], std::max(1e-9, median));
    }
  }
  return best;
}

/// Means over clusters of views, NaN left out.
std::vector<double> ClusterMeans(const std::vector<double>& of_view, const std::vector<int>& cluster) {
  const size_t clusters = cluster.empty() ? 0 : static_cast<size_t>(*std::max_element(cluster.begin(), cluster.end())) + 1;
  std::vector<double> sum(clusters, 0), count(clusters, 0);
  for (size_t v = 0; v < of_view.size(); ++v) {
    if (!std::isnan(of_view[v])) sum[cluster[v]] += of_view[v], count[cluster[v]] += 1;
  }
  for (size_t i = 0; i < clusters; ++i) sum[i] /= count[i];
  return sum;
}

/// Mean squares of all clusters of views in units of each camera's best median, capped; NaN where one takes no part.
std::vector<double> Scores(const LensCandidate& candidate, const std::vector<double>& best) {
  std::vector<double> scores;
  for (size_t v = 0; v < candidate.fit.views.size(); ++v) {
    const auto& errors = candidate.holdout.view_errors_px[v];
    double sum = 0;
    for (double e : errors) {
      const double relative = std::min(kCapOfMedian, e / best[candidate.fit.views[v].camera_idx]);
      sum += relative * relative;
    }
    scores.push_back(errors.empty() ? std::numeric_limits<double>::quiet_NaN() : sum / static_cast<double>(errors.size()));
  }
  return ClusterMeans(scores, candidate.fit.cluster);
}

constexpr double kFoldSlack = 0.02;  // of the image
constexpr double kLikely = 1.5;      // standard errors over clusters: the gain is not one board's

/// Largest share of the image in which one of the lenses is folded.
double MostFolded(const LensCandidate& candidate) {
  double folded = 0;
  for (const geometry::Camera& camera : candidate.fit.state.cameras) folded = std::max(folded, FoldedShare(camera));
  return folded;
}

/// Squared residuals of the boards themselves in standard deviations, gross errors capped, per cluster of views.
std::vector<double> ClusterSquares(const LensPool& fit, double sigma_px) {
  constexpr double kCapSigmas = 6;
  std::vector<double> squares(static_cast<size_t>(CountClusters(fit.cluster)), 0);
  const auto distances = Standardized(fit.views, fit.state, fit.prior);
  for (size_t v = 0; v < fit.views.size(); ++v) {
    for (Eigen::Index k = 0; k < distances[v].size(); ++k) {
      const double sigmas = fit.prior[v][k] > 0 ? std::min(kCapSigmas, distances[v][k] / sigma_px) : 0;
      squares[static_cast<size_t>(fit.cluster[v])] += sigmas * sigmas;
    }
  }
  return squares;
}

/// Noise of the best fit.
double SmallestSigma(const std::vector<LensCandidate>& candidates) {
  double sigma_px = std::numeric_limits<double>::infinity();
  for (const LensCandidate& candidate : candidates) {
    if (candidate.fit.bundle.sigma_px > 0) sigma_px = std::min(sigma_px, candidate.fit.bundle.sigma_px);
  }
  return sigma_px;
}

/// The cost of a lens's parameters: Schwarz, "Estimating the dimension of a model", 1978.
double SchwarzCost(const LensCandidate& candidate) {
  double corners = 0;
  for (const Eigen::VectorXd& weights : candidate.fit.prior) corners += static_cast<double>((weights.array() > 0).count());
  return NumLensParams(candidate.config, static_cast<int>(candidate.fit.state.cameras.size())) *
         std::log(std::max(2.0, corners));
}

double Sum(const std::vector<double>& values) { return std::accumulate(values.begin(), values.end(), 0.0); }

/// The configuration by the residuals of the boards themselves, where these are too few to hold any out.
int JudgeByEvidence(const std::vector<LensCandidate>& candidates, std::string* reason) {
  const double sigma_px = SmallestSigma(candidates);
  int best = -1;
  double best_cost = std::numeric_limits<double>::infinity();
  for (size_t i = 0; i < candidates.size(); ++i) {
    const double cost = Sum(ClusterSquares(candidates[i].fit, sigma_px)) + SchwarzCost(candidates[i]);
    if (cost < best_cost) best_cost = cost, best = static_cast<int>(i);
  }
  if (best >= 0)
    *reason =
        ToString(candidates[best].config) + " is what the few boards call for (Schwarz's criterion); too few to hold any out";
  return best;
}

/// Tests whether `richer` explains the boards better than `simpler` by more than its parameters cost, and not only on one
/// or two boards. Held-out errors are almost insensitive to a term that acts where few boards are, or that the boards'
/// poses compensate.
std::optional<double> GainOf(const LensCandidate& simpler, const LensCandidate& richer, double sigma_px) {
  std::vector<double> a = ClusterSquares(simpler.fit, sigma_px);
  const std::vector<double> b = ClusterSquares(richer.fit, sigma_px);
  if (a.size() != b.size()) return std::nullopt;
  std::transform(a.begin(), a.end(), b.begin(), a.begin(), std::minus<>());
  return GainBeyondCost(a, SchwarzCost(richer) - SchwarzCost(simpler), kLikely);
}

/// Among the candidates that held-out boards do not tell from the best: `simplest`, or the richer one that the boards call for.
int BestSupported(const std::vector<LensCandidate>& candidates, int simplest) {
  const double sigma_px = SmallestSigma(candidates);
  const double folded = MostFolded(candidates[simplest]);
  int best = simplest;
  double most = 0;
  for (size_t i = 0; i < candidates.size(); ++i) {
    if (!candidates[i].within_one_se || static_cast<int>(i) == simplest || MostFolded(candidates[i]) > folded + kFoldSlack)
      continue;
    const auto gain = GainOf(candidates[simplest], candidates[i], sigma_px);
    if (gain && *gain > most) most = *gain, best = static_cast<int>(i);
  }
  return best;
}

/// Prefers Kannala and Brandt's four radial terms to a lens of another wide family that held-out boards barely prefer.
/// Families are not simpler versions of each other, and a curve of one parameter extrapolates to the image where no board
/// was. It may fold there: beyond the circle of a wide lens there is no image.
int OfRichestFamily(const std::vector<LensCandidate>& candidates, int chosen) {
  constexpr double kSmallLoss = 0.02;  // about what two more numbers cost on few boards
  const LensConfig& config = candidates[chosen].config;
  const geometry::LensTraits& traits = geometry::TraitsOf(config.model);
  const LensModel wanted = traits.decentring < 0 ? LensModel::kKannalaBrandt4 : LensModel::kKannalaBrandt4P;
  if (!traits.wide || traits.has_grid || config.model == wanted) return chosen;
  for (size_t i = 0; i < candidates.size(); ++i) {
    const LensCandidate& other = candidates[i];
    const bool near = other.within_one_se || other.relative_error <= (1 + kSmallLoss) * candidates[chosen].relative_error;
    if (near && other.config.model == wanted && other.config.shared == config.shared) return static_cast<int>(i);
  }
  return chosen;
}

std::string CalledFor(const LensCandidate& chosen, const LensCandidate& simplest, const LensCandidate& best) {
  return Format(
      "%s is within one standard error of the best (%s) like %s, but its boards call for its further terms "
      "(Schwarz's criterion)",
      ToString(chosen.config).c_str(), ToString(best.config).c_str(), ToString(simplest.config).c_str());
}

std::string Instead(const LensCandidate& chosen, const LensCandidate& other) {
  return Format("%s is as good as %s, which is no simpler version of it: held-out error %+.1f %%",
                ToString(chosen.config).c_str(), ToString(other.config).c_str(),
                100 * (chosen.relative_error / other.relative_error - 1));
}

/// The first candidate within one standard error of the best, of those whose lenses fold least inside the image.
int SimplestWithin(const std::vector<LensCandidate>& candidates) {
  std::vector<double> folded(candidates.size(), std::numeric_limits<double>::infinity());
  for (size_t i = 0; i < candidates.size(); ++i) {
    if (!candidates[i].within_one_se) continue;
    folded[i] = MostFolded(candidates[i]);
  }
  for (size_t i = 0; i < candidates.size(); ++i) {
    if (folded[i] <= *std::min_element(folded.begin(), folded.end()) + kFoldSlack && candidates[i].within_one_se)
      return static_cast<int>(i);
  }
  return -1;
}

/// Fills the candidates' scores; returns the index of the simplest within one standard error of the best, or -1.
int Judge(std::vector<LensCandidate>* candidates, int num_cameras, std::string* reason) {
  const std::vector<double> best_medians = BestMedians(*candidates, num_cameras);
  if (std::none_of(best_medians.begin(), best_medians.end(), [](double median) { return std::isfinite(median); })) return -1;
  std::vector<HeldOutCandidate> held_out;
  for (LensCandidate& candidate : *candidates) {
    const std::vector<double> scores = Scores(candidate, best_medians);
    candidate.relative_error = std::sqrt(MeanLoss(scores));
    held_out.push_back({ToString(candidate.config), scores, candidate.relative_error});
  }
  HeldOutRule rule;  // a gain of less than a percent that is beyond doubt is a term that the lens has, small as it is
  rule.relative = kNegligibleGain, rule.beyond_doubt = kBeyondDoubt;
  const HeldOutChoice choice = ChooseHeldOut(held_out, rule);
  for (size_t i = 0; i < candidates->size(); ++i) (*candidates)[i].within_one_se = choice.verdicts[i].as_good;
  const int simplest = SimplestWithin(*candidates);
  if (simplest < 0) return simplest;
  const int supported = BestSupported(*candidates, simplest), chosen = OfRichestFamily(*candidates, supported);
  if (chosen != supported) {
    *reason = Instead((*candidates)[chosen], (*candidates)[supported]);
    return chosen;
  }
  *reason = chosen == choice.best || chosen == simplest
                ? HeldOutReason(held_out, choice, chosen)
                : CalledFor((*candidates)[chosen], (*candidates)[simplest], (*candidates)[choice.best]);
  return chosen;
}

LensCandidate Try(const LensPool& pool, const LensConfig& config, const SelectionOptions& options,
                  const BundleOptions& bundle) {
  LensCandidate candidate;
  candidate.config = config;
  candidate.fit = FitPool(pool, config, bundle);
  if (candidate.fit.status != Status::kOk && candidate.fit.status != Status::kNotConverged) {
    candidate.holdout.status = candidate.fit.status;
    candidate.holdout.view_errors_px.resize(pool.views.size());
    return candidate;
  }
  const int folds = LargestNumCorners(pool) > kManyCorners ? std::min(options.folds, kFewFolds) : options.folds;
  candidate.holdout = HoldoutErrors(candidate.fit, folds, options.max_views, bundle);
  return candidate;
}

/// How far the lenses of a separate fit are apart, in chi-square over degrees of freedom: 1 for cameras with one lens. NaN when
/// the data leave some lens open.
double Disagreement(const LensPool& fit) {
  BundleOptions options;
  options.gauge = {Gauge::Kind::kNone, 0};
  options.refine_cameras = options.refine_boards = false;
  options.refine_warp = fit.config.warp, options.refine_stretch = fit.config.stretch;
  const RigCovariance covariance = ComputeCovariance(fit.views, fit.state, options, fit.bundle.sigma_px);
  if (covariance.status != Status::kOk) return std::numeric_limits<double>::quiet_NaN();
  const Eigen::Index n = fit.state.cameras[0].params.size();
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(n, n);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(n);
  std::vector<Eigen::MatrixXd> each;
  for (size_t c = 0; c < fit.state.cameras.size(); ++c) {
    each.push_back(covariance.params[c].ldlt().solve(Eigen::MatrixXd::Identity(n, n)));
    information += each.back();
    right += each.back() * fit.state.cameras[c].params;
  }
  const Eigen::VectorXd mean = information.ldlt().solve(right);
  double chi_square = 0;
  for (size_t c = 0; c < fit.state.cameras.size(); ++c) {
    const Eigen::VectorXd difference = fit.state.cameras[c].params - mean;
    chi_square += difference.dot(each[c] * difference);
  }
  return chi_square / static_cast<double>(n * (fit.state.cameras.size() - 1));
}

/// Held-out errors are almost insensitive to a wrong focal length, because the boards' poses compensate for it; the
/// cameras' own lenses reveal it. When these differ by more than their uncertainty, the lens is not shared, unless sharing
/// makes the held-out error clearly smaller. With few boards per camera, one good lens for all is better than a bad one
/// for each.
bool SharingMisleads(const std::vector<LensCandidate>& candidates, const LensCandidate& chosen) {
  constexpr double kMaxDisagreement = 2, kClearGain = 0.03;
  for (const LensCandidate& candidate : candidates) {
    const LensConfig& config = candidate.config;
    if (config.shared || config.model != chosen.config.model || !(config.spline == chosen.config.spline)) continue;
    if (chosen.relative_error < (1 - kClearGain) * candidate.relative_error) return false;
    return Disagreement(candidate.fit) > kMaxDisagreement;
  }
  return false;
}

/// Candidates without a solution are left out.
void DropFailed(std::vector<LensCandidate>* candidates) {
  candidates->erase(std::remove_if(candidates->begin(), candidates->end(),
                                   [](const LensCandidate& c) { return c.holdout.status != Status::kOk; }),
                    candidates->end());
}

/// Enough boards in different places for errors on boards that took no part.
bool EnoughClusters(const LensPool& pool) {
  const std::vector<int> clusters = ClustersOfCameras(pool);
  return CountClusters(pool.cluster) >= kMinClusters &&
         *std::max_element(clusters.begin(), clusters.end()) >= kMinClustersOfCamera;
}

LensChoice ChooseByEvidence(const LensPool& pool, const SelectionOptions& options, const BundleOptions& bundle) {
  LensChoice choice;
  for (const LensConfig& config : Configurations(pool, options, true)) {
    LensCandidate candidate;
    candidate.config = config;
    candidate.fit = FitPool(pool, config, bundle);
    candidate.holdout.status = Status::kTooFewViews;
    candidate.holdout.view_errors_px.resize(pool.views.size());
    candidate.relative_error = std::numeric_limits<double>::quiet_NaN();
    const Status status = candidate.fit.status;
    if (status == Status::kOk || status == Status::kNotConverged) choice.candidates.push_back(std::move(candidate));
  }
  choice.index = JudgeByEvidence(choice.candidates, &choice.reason);
  return choice;
}

}  // namespace

LensChoice ChooseLens(const LensPool& pool, const SelectionOptions& options, const BundleOptions& bundle,
                      const RunContext& run) {
  LensChoice choice;
  choice.reason = std::string(geometry::ToString(pool.state.cameras[0].model)) + ": no lens could be compared";
  if (!EnoughClusters(pool)) return ChooseByEvidence(pool, options, bundle);
  const std::vector<LensConfig> configs = Configurations(pool, options, false);
  choice.candidates.resize(configs.size());
  BundleOptions single = bundle;
  single.num_threads = 1;
  ParallelFor(static_cast<int64_t>(configs.size()), run.num_threads,
              [&](int64_t i) { choice.candidates[i] = Try(pool, configs[i], options, single); });
  DropFailed(&choice.candidates);
  if (choice.candidates.empty()) return choice;
  std::string reason;
  choice.index = Judge(&choice.candidates, static_cast<int>(pool.state.cameras.size()), &reason);
  const int cameras = static_cast<int>(pool.state.cameras.size());
  const bool shared = choice.index >= 0 && choice.candidates[choice.index].config.shared;
  if (shared && SharingMisleads(choice.candidates, choice.candidates[choice.index])) {
    auto& all = choice.candidates;
    all.erase(std::remove_if(all.begin(), all.end(), [](const LensCandidate& c) { return c.config.shared; }), all.end());
    choice.index = Judge(&all, cameras, &reason);
    reason += "; the cameras' lenses differ by more than their uncertainty, so they are not shared";
  }
  if (choice.index >= 0) choice.reason = reason;
  return choice;
}

namespace {

ShapeChoice ChooseShape(const LensPool& pool, const LensConfig& without, const LensConfig& with,
                        const SelectionOptions& options, const BundleOptions& bundle, const RunContext& run) {
  ShapeChoice choice;
  choice.reason = "too few views to see the shape of the board";
  if (!EnoughClusters(pool)) return choice;
  std::vector<LensCandidate> candidates(2);
  BundleOptions single = bundle;
  single.num_threads = 1;
  ParallelFor(2, run.num_threads, [&](int64_t i) { candidates[i] = Try(pool, i == 0 ? without : with, options, single); });
  DropFailed(&candidates);
  if (candidates.size() < 2) return choice;
  choice.pays = Judge(&candidates, static_cast<int>(pool.state.cameras.size()), &choice.reason) == 1;
  choice.error_without = candidates[0].relative_error;
  choice.error_with = candidates[1].relative_error;
  return choice;
}

}  // namespace

ShapeChoice ChooseWarp(const LensPool& pool, const SelectionOptions& options, const BundleOptions& bundle,
                       const RunContext& run) {
  LensConfig without = pool.config, with = pool.config;
  without.warp = false, with.warp = true;
  return ChooseShape(pool, without, with, options, bundle, run);
}

ShapeChoice ChooseStretch(const LensPool& pool, const SelectionOptions& options, const BundleOptions& bundle,
                          const RunContext& run) {
  LensConfig without = pool.config, with = pool.config;
  without.warp = with.warp = options.warp;
  without.stretch = false, with.stretch = true;
  return ChooseShape(pool, without, with, options, bundle, run);
}

}  // namespace mvstudio::calib
