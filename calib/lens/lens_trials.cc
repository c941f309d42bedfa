#include "calib/lens/lens_trials.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <utility>

#include "calib/bundle/camera_noise.h"
#include "calib/lens/lens_configs.h"
#include "calib/lens/lens_judge.h"
#include "calib/lens/smooth_error.h"
#include "core/choice/heldout_choice.h"
#include "core/parallel.h"

namespace mvstudio::calib {
namespace {

constexpr int kManyCorners = 5000, kFewFolds = 3;  // large problems lose little by fewer folds
constexpr double kSureLoss = 0.02, kSureStandardErrors = 2;
constexpr double kAtNoise = 1.02;  // residuals over those that are not smooth over the boards

bool Fitted(const LensCandidate& candidate) {
  return candidate.fit.status == Status::kOk || candidate.fit.status == Status::kNotConverged;
}

int NumParams(const LensCandidate& candidate) {
  return NumLensParams(candidate.config, static_cast<int>(candidate.fit.state.cameras.size()));
}

bool IsGrid(const LensConfig& config) { return config.model == geometry::LensModel::kSplined; }

/// Kannala and Brandt's lens stands for its family whatever it gains (JudgeLenses).
bool IsStandard(const LensConfig& config) {
  return config.model == geometry::LensModel::kKannalaBrandt4 || config.model == geometry::LensModel::kKannalaBrandt4P;
}

/// Whether the candidate's errors already exceed the held-out ones of `best` with lenses in which these very boards took part.
bool LosesSurely(const LensCandidate& candidate, const LensCandidate& best) {
  const std::vector<double> medians = BestMedians({best}, static_cast<int>(best.fit.state.cameras.size()));
  const std::vector<double> of_best = ClusterScores(best.fit, best.holdout.view_errors_px, medians);
  const std::vector<double> own = ClusterScores(candidate.fit, ErrorsOnOwnBoards(candidate.fit), medians);
  const UnitMean worse_by = DifferenceOverUnits(own, of_best);
  const double loss = MeanLoss(of_best);
  return worse_by.num_units > 1 && worse_by.mean > 2 * kSureLoss * loss &&
         worse_by.mean > kSureStandardErrors * worse_by.standard_error;
}

/// A curve of one or two parameters and its decentred version: Kannala and Brandt's lens takes its place wherever that does as
/// well (JudgeLenses), so a curve can win only where that one leaves something to explain.
bool IsShortCurve(const LensConfig& config) { return geometry::IsWide(config.model) && !IsGrid(config) && !IsStandard(config); }

/// How much more of the boards' residuals the candidate explains, in variances of a coordinate.
double GainOver(const LensCandidate& candidate, const LensCandidate& best, double sigma_px) {
  const std::vector<double> a = ClusterSquares(best.fit, sigma_px), b = ClusterSquares(candidate.fit, sigma_px);
  return std::accumulate(a.begin(), a.end(), 0.0) - std::accumulate(b.begin(), b.end(), 0.0);
}

/// Whether `simpler` is a case of the other lens: some of its terms zero, or one lens for all cameras.
bool IsCaseOf(const LensConfig& simpler, const LensConfig& richer) {
  if (IsGrid(simpler) || IsGrid(richer) || simpler.shared < richer.shared) return false;
  if (simpler.model == richer.model) return simpler.shared != richer.shared;
  if (geometry::IsWide(richer.model)) return geometry::WithDecentring(simpler.model) == richer.model;
  auto model = geometry::TraitsOf(richer.model).simpler;
  while (model && *model != simpler.model) model = geometry::TraitsOf(*model).simpler;
  return model.has_value();
}

/// Whether its further terms explain no more than noise would, one coordinate's variance each, or less than they cost and a
/// negligible part of the whole: held-out boards gain less than those that take part.
bool ExplainsNothing(const LensCandidate& richer, const LensCandidate& simpler, double sigma_px) {
  const double gain = GainOver(richer, simpler, sigma_px);
  if (gain <= NumParams(richer) - NumParams(simpler)) return true;
  const std::vector<double> squares = ClusterSquares(simpler.fit, sigma_px);
  const double all = std::accumulate(squares.begin(), squares.end(), 0.0);
  return gain <= SchwarzCost(richer) - SchwarzCost(simpler) && gain <= 2 * kNegligibleGain * all;
}

/// Whether a smoother lens could still explain something: what varies smoothly over a board, in any camera. Boards of few
/// corners do not say.
bool LeavesSmoothErrors(const LensPool& fit) {
  const auto residuals = BundleResiduals(fit.views, fit.state);
  const std::vector<double> sigmas =
      CameraSigmas(fit.views, fit.prior, fit.bundle.sigma_px, static_cast<int>(fit.state.cameras.size()));
  for (size_t c = 0; c < fit.state.cameras.size(); ++c) {
    const double noise = SmoothErrorPx(fit.views, residuals, static_cast<int>(c));
    if (!(std::sqrt(2.0) * sigmas[c] <= kAtNoise * noise)) return true;
  }
  return false;
}

class Trials {
 public:
  Trials(const LensPool& pool, const SelectionOptions& options, const BundleOptions& bundle, const RunContext& run)
      : pool_(pool), options_(options), bundle_(bundle), run_(run) {
    bundle_.num_threads = 1;
  }

  /// Fits them, appended in order; those without a solution are left out.
  std::vector<size_t> Fit(const std::vector<LensConfig>& configs) {
    std::vector<LensCandidate> fits(configs.size());
    ParallelFor(static_cast<int64_t>(configs.size()), run_.num_threads, [&](int64_t i) {
      fits[static_cast<size_t>(i)] = FitCandidate(pool_, configs[static_cast<size_t>(i)], bundle_);
    });
    std::vector<size_t> added;
    for (LensCandidate& fit : fits) {
      if (!Fitted(fit)) continue;
      added.push_back(candidates_.size());
      candidates_.push_back(std::move(fit));
      held_out_.push_back(false);
    }
    return added;
  }

  void HoldOutThese(const std::vector<size_t>& indices) {
    ParallelFor(static_cast<int64_t>(indices.size()), run_.num_threads,
                [&](int64_t i) { HoldOut(options_, bundle_, &candidates_[indices[static_cast<size_t>(i)]]); });
    for (const size_t i : indices) held_out_[i] = true;
  }

  /// Of those that are not held out yet, the ones that can win against `best`.
  std::vector<size_t> Hopeful(const std::vector<size_t>& of, size_t best) const {
    std::vector<char> can_win(of.size(), false);
    ParallelFor(static_cast<int64_t>(of.size()), run_.num_threads, [&](int64_t i) {
      can_win[static_cast<size_t>(i)] = !held_out_[of[static_cast<size_t>(i)]] && CanWin(of[static_cast<size_t>(i)], best);
    });
    std::vector<size_t> hopeful;
    for (size_t i = 0; i < of.size(); ++i) {
      if (can_win[i]) hopeful.push_back(of[i]);
    }
    return hopeful;
  }

  /// The one with the smallest held-out error.
  size_t Best() const {
    std::vector<LensCandidate> scored;
    size_t best = 0;
    double smallest = std::numeric_limits<double>::infinity();
    const std::vector<double> medians = BestMedians(candidates_, static_cast<int>(pool_.state.cameras.size()));
    for (size_t i = 0; i < candidates_.size(); ++i) {
      if (!held_out_[i] || candidates_[i].holdout.status != Status::kOk) continue;
      const double loss = MeanLoss(ClusterScores(candidates_[i].fit, candidates_[i].holdout.view_errors_px, medians));
      if (loss < smallest) smallest = loss, best = i;
    }
    return best;
  }

  const std::vector<LensCandidate>& candidates() const { return candidates_; }

  std::vector<LensCandidate> Take() {
    std::vector<LensCandidate> taken;
    for (size_t i = 0; i < candidates_.size(); ++i) {
      if (held_out_[i] && candidates_[i].holdout.status == Status::kOk) taken.push_back(std::move(candidates_[i]));
    }
    std::stable_sort(taken.begin(), taken.end(),
                     [](const LensCandidate& a, const LensCandidate& b) { return NumParams(a) < NumParams(b); });
    return taken;
  }

 private:
  bool CanWin(size_t index, size_t best) const {
    const LensCandidate& candidate = candidates_[index];
    const double sigma_px = SmallestSigma(candidates_);
    const auto in_vain = [&](const LensCandidate& other) {
      return IsCaseOf(other.config, candidate.config) && ExplainsNothing(candidate, other, sigma_px);
    };
    if (std::any_of(candidates_.begin(), candidates_.end(), in_vain)) return false;
    const bool more = NumParams(candidate) > NumParams(candidates_[best]) && !IsStandard(candidate.config);
    if (more && ExplainsNothing(candidate, candidates_[best], sigma_px)) return false;
    return !LosesSurely(candidate, candidates_[best]);
  }

  const LensPool& pool_;
  SelectionOptions options_;
  BundleOptions bundle_;
  RunContext run_;
  std::vector<LensCandidate> candidates_;
  std::vector<bool> held_out_;
};

/// Grids from coarse to fine, shared like the best lens, until a finer one explains no more than its numbers cost.
void TryGrids(const std::vector<LensConfig>& grids, Trials* trials) {
  size_t best = trials->Best();
  double before = std::numeric_limits<double>::infinity();
  for (const LensConfig& grid : grids) {
    if (grid.shared != trials->candidates()[best].config.shared) continue;
    const std::vector<size_t> fitted = trials->Fit({grid});
    if (fitted.empty()) return;
    const LensCandidate& fit = trials->candidates()[fitted[0]];
    if (!(fit.fit.bundle.sigma_px < before)) return;
    before = fit.fit.bundle.sigma_px;
    trials->HoldOutThese(trials->Hopeful(fitted, best));
    const size_t now = trials->Best();
    if (now == best && IsGrid(trials->candidates()[best].config)) return;
    best = now;
  }
}

}  // namespace

LensCandidate FitCandidate(const LensPool& pool, const LensConfig& config, const BundleOptions& bundle) {
  LensCandidate candidate;
  candidate.config = config;
  candidate.fit = FitPool(pool, config, bundle);
  candidate.holdout.status = candidate.fit.status;
  candidate.holdout.view_errors_px.resize(pool.views.size());
  return candidate;
}

void HoldOut(const SelectionOptions& options, const BundleOptions& bundle, LensCandidate* candidate) {
  if (!Fitted(*candidate)) return;
  const int folds = LargestNumCorners(candidate->fit) > kManyCorners ? std::min(options.folds, kFewFolds) : options.folds;
  candidate->holdout = HoldoutErrors(candidate->fit, folds, options.max_views, bundle);
}

std::vector<LensCandidate> TryLenses(const LensPool& pool, const std::vector<LensConfig>& configs,
                                     const SelectionOptions& options, const BundleOptions& bundle, const RunContext& run) {
  std::vector<LensConfig> formulas, curves, grids;
  const bool standard = std::any_of(configs.begin(), configs.end(), IsStandard);
  for (const LensConfig& config : configs)
    (IsGrid(config) ? grids : standard && IsShortCurve(config) ? curves : formulas).push_back(config);
  Trials trials(pool, options, bundle, run);
  const bool asked = formulas.empty() || !options.models.empty();
  std::vector<size_t> fitted = trials.Fit(asked ? configs : formulas);
  if (fitted.empty() && !asked) fitted = trials.Fit(std::exchange(curves, {}));
  if (fitted.empty()) return {};
  if (asked) {
    trials.HoldOutThese(fitted);
    return trials.Take();
  }
  const int first = std::max(0, CheapestByEvidence(trials.candidates()));
  trials.HoldOutThese({static_cast<size_t>(first)});
  trials.HoldOutThese(trials.Hopeful(fitted, static_cast<size_t>(first)));
  if ((curves.empty() && grids.empty()) || !LeavesSmoothErrors(trials.candidates()[trials.Best()].fit)) return trials.Take();
  trials.HoldOutThese(trials.Hopeful(trials.Fit(curves), trials.Best()));
  TryGrids(grids, &trials);
  return trials.Take();
}

}  // namespace mvstudio::calib
