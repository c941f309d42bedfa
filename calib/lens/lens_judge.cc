#include "calib/lens/lens_judge.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>
#include <optional>

#include "calib/bundle/camera_noise.h"
#include "calib/bundle/view_clusters.h"
#include "calib/lens/evidence.h"
#include "calib/lens/lens_beyond.h"
#include "calib/lens/lens_configs.h"
#include "core/choice/heldout_choice.h"
#include "core/format.h"

namespace mvstudio::calib {
namespace {

using geometry::LensModel;

constexpr double kCapOfMedian = 6;  // errors count as at most so many medians of the best candidate

}  // namespace

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

namespace {

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

}  // namespace

std::vector<double> ClusterScores(const LensPool& fit, const std::vector<std::vector<double>>& view_errors_px,
                                  const std::vector<double>& best) {
  std::vector<double> scores;
  for (size_t v = 0; v < fit.views.size(); ++v) {
    const auto& errors = view_errors_px[v];
    double sum = 0;
    for (double e : errors) {
      const double relative = std::min(kCapOfMedian, e / best[fit.views[v].camera_idx]);
      sum += relative * relative;
    }
    scores.push_back(errors.empty() ? std::numeric_limits<double>::quiet_NaN() : sum / static_cast<double>(errors.size()));
  }
  return ClusterMeans(scores, fit.cluster);
}

namespace {

constexpr double kLikely = 1.5;  // standard errors over clusters: the gain is not one board's

/// Largest share of the image in which one of the lenses is folded.
double MostFolded(const LensCandidate& candidate) {
  double folded = 0;
  for (const geometry::Camera& camera : candidate.fit.state.cameras) folded = std::max(folded, FindFolds(camera).share);
  return folded;
}

}  // namespace

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

double SmallestSigma(const std::vector<LensCandidate>& candidates) {
  double sigma_px = std::numeric_limits<double>::infinity();
  for (const LensCandidate& candidate : candidates) {
    if (candidate.fit.bundle.sigma_px > 0) sigma_px = std::min(sigma_px, candidate.fit.bundle.sigma_px);
  }
  return sigma_px;
}

double SchwarzCost(const LensCandidate& candidate) {
  double corners = 0;
  for (const Eigen::VectorXd& weights : candidate.fit.prior) corners += static_cast<double>((weights.array() > 0).count());
  return NumLensParams(candidate.config, static_cast<int>(candidate.fit.state.cameras.size())) *
         std::log(std::max(2.0, corners));
}

int CheapestByEvidence(const std::vector<LensCandidate>& candidates) {
  const double sigma_px = SmallestSigma(candidates);
  int best = -1;
  double best_cost = std::numeric_limits<double>::infinity();
  for (size_t i = 0; i < candidates.size(); ++i) {
    const std::vector<double> squares = ClusterSquares(candidates[i].fit, sigma_px);
    const double cost = std::accumulate(squares.begin(), squares.end(), 0.0) + SchwarzCost(candidates[i]);
    if (cost < best_cost) best_cost = cost, best = static_cast<int>(i);
  }
  return best;
}

namespace {

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

}  // namespace

int JudgeLenses(std::vector<LensCandidate>* candidates, int num_cameras, std::string* reason) {
  const std::vector<double> best_medians = BestMedians(*candidates, num_cameras);
  if (std::none_of(best_medians.begin(), best_medians.end(), [](double median) { return std::isfinite(median); })) return -1;
  std::vector<HeldOutCandidate> held_out;
  for (LensCandidate& candidate : *candidates) {
    const std::vector<double> scores = ClusterScores(candidate.fit, candidate.holdout.view_errors_px, best_medians);
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

}  // namespace mvstudio::calib
