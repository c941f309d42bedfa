#include "calib/lens/model_selection.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "calib/bundle/view_clusters.h"
#include "calib/covariance/uncertainty.h"
#include "calib/lens/lens_beyond.h"
#include "calib/lens/lens_configs.h"
#include "calib/lens/lens_judge.h"
#include "calib/lens/lens_trials.h"

namespace mvstudio::calib {
namespace {

constexpr int kMinClusters = 6, kMinClustersOfCamera = 3;

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

/// Enough boards in different places for errors on boards that took no part.
bool EnoughClusters(const LensPool& pool) {
  const std::vector<int> clusters = ClustersOfCameras(pool);
  return CountClusters(pool.cluster) >= kMinClusters &&
         *std::max_element(clusters.begin(), clusters.end()) >= kMinClustersOfCamera;
}

/// The choice as it passes the verdict where no board was.
void LookBeyond(const std::vector<bool>& near, const SelectionOptions& options, const BundleOptions& bundle,
                LensChoice* choice) {
  if (choice->index < 0 || !options.models.empty()) return;
  const int taken = PassingLens(choice->candidates, near, choice->index, bundle, options.need_px, &choice->beyond);
  if (taken == choice->index) return;
  choice->index = taken;
  choice->reason = std::exchange(choice->beyond, "");
}

/// Lenses that explain the few boards about as well as the chosen one.
std::vector<bool> NearByEvidence(const std::vector<LensCandidate>& candidates, int chosen) {
  constexpr double kWorse = 1.5;  // of the sum of squares
  const double sigma_px = SmallestSigma(candidates);
  const auto squares = [&](const LensCandidate& candidate) {
    const std::vector<double> clusters = ClusterSquares(candidate.fit, sigma_px);
    return std::accumulate(clusters.begin(), clusters.end(), 0.0);
  };
  const double limit = kWorse * squares(candidates[static_cast<size_t>(chosen)]);
  std::vector<bool> near;
  for (const LensCandidate& candidate : candidates) near.push_back(squares(candidate) <= limit);
  return near;
}

LensChoice ChooseByEvidence(const LensPool& pool, const SelectionOptions& options, const BundleOptions& bundle) {
  LensChoice choice;
  for (const LensConfig& config : Configurations(pool, options, true)) {
    LensCandidate candidate = FitCandidate(pool, config, bundle);
    const Status status = std::exchange(candidate.holdout.status, Status::kTooFewViews);
    candidate.relative_error = std::numeric_limits<double>::quiet_NaN();
    if (status == Status::kOk || status == Status::kNotConverged) choice.candidates.push_back(std::move(candidate));
  }
  choice.index = CheapestByEvidence(choice.candidates);
  if (choice.index < 0) return choice;
  choice.reason = ToString(choice.candidates[static_cast<size_t>(choice.index)].config) +
                  " is what the few boards call for (Schwarz's criterion); too few to hold any out";
  LookBeyond(NearByEvidence(choice.candidates, choice.index), options, bundle, &choice);
  return choice;
}

}  // namespace

LensChoice ChooseLens(const LensPool& pool, const SelectionOptions& options, const BundleOptions& bundle,
                      const RunContext& run) {
  if (!EnoughClusters(pool)) return ChooseByEvidence(pool, options, bundle);
  LensChoice choice;
  choice.reason = std::string(geometry::ToString(pool.state.cameras[0].model)) + ": no lens could be compared";
  choice.candidates = TryLenses(pool, Configurations(pool, options, false), options, bundle, run);
  if (choice.candidates.empty()) return choice;
  const int cameras = static_cast<int>(pool.state.cameras.size());
  std::string reason;
  choice.index = JudgeLenses(&choice.candidates, cameras, &reason);
  const bool shared = choice.index >= 0 && choice.candidates[static_cast<size_t>(choice.index)].config.shared;
  if (shared && SharingMisleads(choice.candidates, choice.candidates[static_cast<size_t>(choice.index)])) {
    auto& all = choice.candidates;
    all.erase(std::remove_if(all.begin(), all.end(), [](const LensCandidate& c) { return c.config.shared; }), all.end());
    choice.index = JudgeLenses(&all, cameras, &reason);
    reason += "; the cameras' lenses differ by more than their uncertainty, so they are not shared";
  }
  if (choice.index >= 0) choice.reason = reason;
  if (choice.index >= 0) LookBeyond(NearTheBest(choice.candidates, choice.index), options, bundle, &choice);
  return choice;
}

namespace {

ShapeChoice ChooseShape(const LensPool& pool, const LensConfig& without, const LensConfig& with,
                        const SelectionOptions& options, const BundleOptions& bundle, const RunContext& run) {
  ShapeChoice choice;
  choice.reason = "too few views to see the shape of the board";
  if (!EnoughClusters(pool)) return choice;
  SelectionOptions both = options;
  both.models = {without, with};
  std::vector<LensCandidate> candidates = TryLenses(pool, both.models, both, bundle, run);
  if (candidates.size() < 2) return choice;
  choice.untried = false;
  choice.pays = JudgeLenses(&candidates, static_cast<int>(pool.state.cameras.size()), &choice.reason) == 1;
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
