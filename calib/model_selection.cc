#include "calib/model_selection.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "calib/uncertainty.h"
#include "core/parallel.h"

namespace mvstudio::calib {
namespace {

using geometry::LensModel;

constexpr int kMinViews = 6, kMinViewsOfCamera = 3;
constexpr double kWideRad = 0.70;                  // corners farther from the axis than this make fisheye models worth a try
constexpr double kVeryWideRad = 1.55;              // beyond this, perspective models are not
constexpr int kMinSplineCorners = 5000;            // of one camera
constexpr int kManyCorners = 5000, kFewFolds = 3;  // large problems lose little by fewer folds
constexpr double kCapOfMedian = 6;                 // errors count as at most so many medians of the best candidate

/// Mean of the paired differences and its standard error.
struct Difference {
  double mean = 0, standard_error = 0;
};

Difference Compare(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0, squares = 0;
  int n = 0;
  for (size_t v = 0; v < b.size(); ++v) {
    if (std::isnan(b[v]) || std::isnan(a[v])) continue;
    sum += a[v] - b[v], squares += (a[v] - b[v]) * (a[v] - b[v]), ++n;
  }
  if (n < 2) return {};
  const double mean = sum / n;
  return {mean, std::sqrt(std::max(0.0, squares / n - mean * mean) / (n - 1))};
}

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

/// Mean squares of all views in units of each camera's best median, capped; NaN where a view takes no part.
std::vector<double> ViewScores(const LensCandidate& candidate, const std::vector<double>& best) {
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
  return scores;
}

double MeanScore(const std::vector<double>& scores) {
  double sum = 0;
  int n = 0;
  for (double value : scores) {
    if (!std::isnan(value)) sum += value, ++n;
  }
  return n ? sum / n : std::numeric_limits<double>::infinity();
}

std::string Explain(const LensCandidate& chosen, const LensCandidate& best) {
  char text[300];
  const std::string name = ToString(chosen.config), best_name = ToString(best.config);
  if (&chosen == &best) {
    std::snprintf(text, sizeof text, "%s has the smallest held-out error of all lenses tried", name.c_str());
  } else {
    std::snprintf(text, sizeof text, "%s is the simplest within one standard error of the best (%s): held-out error %+.1f %%",
                  name.c_str(), best_name.c_str(), 100 * (chosen.relative_error / best.relative_error - 1));
  }
  return text;
}

/// Fills the candidates' scores; returns the index of the simplest within one standard error of the best, or -1.
int Judge(std::vector<LensCandidate>* candidates, int num_cameras, std::string* reason) {
  const std::vector<double> best_medians = BestMedians(*candidates, num_cameras);
  for (double median : best_medians) {
    if (!std::isfinite(median)) return -1;
  }
  std::vector<std::vector<double>> scores;
  for (LensCandidate& candidate : *candidates) {
    scores.push_back(ViewScores(candidate, best_medians));
    candidate.relative_error = std::sqrt(MeanScore(scores.back()));
  }
  const auto best = std::min_element(candidates->begin(), candidates->end(),
                                     [](const auto& a, const auto& b) { return a.relative_error < b.relative_error; });
  int chosen = -1;
  for (size_t i = 0; i < candidates->size(); ++i) {
    const Difference difference = Compare(scores[i], scores[best - candidates->begin()]);
    LensCandidate& candidate = (*candidates)[i];
    // A gain of less than a percent that is beyond doubt is a term that the lens has, small as it is.
    const bool negligible = candidate.relative_error <= (1 + kNegligibleGain) * best->relative_error &&
                            difference.mean <= kBeyondDoubt * difference.standard_error;
    candidate.within_one_se = difference.mean <= difference.standard_error || negligible;
    if (chosen < 0 && candidate.within_one_se) chosen = static_cast<int>(i);
  }
  if (chosen >= 0) *reason = Explain((*candidates)[chosen], *best);
  return chosen;
}

int LargestNumCorners(const LensPool& pool) {
  std::vector<int> corners(pool.state.cameras.size(), 0);
  for (const View& view : pool.views) corners[view.camera_idx] += static_cast<int>((view.weights.array() > 0).count());
  return *std::max_element(corners.begin(), corners.end());
}

double LargestAngleOf(const LensPool& pool) {
  double angle = 0;
  for (size_t c = 0; c < pool.state.cameras.size(); ++c) {
    std::vector<View> of_camera;
    for (const View& view : pool.views) {
      if (view.camera_idx == static_cast<int>(c)) of_camera.push_back(view);
    }
    angle = std::max(angle, LargestAngle(pool.state.cameras[c], of_camera));
  }
  return angle;
}

/// Models worth comparing for the field of view and the number of corners.
std::vector<LensConfig> Models(const LensPool& pool) {
  const double angle = LargestAngleOf(pool);
  std::vector<LensConfig> models;
  const auto add = [&](std::initializer_list<LensModel> list) {
    for (LensModel model : list) models.push_back({model, {}, false, false});
  };
  if (angle < kVeryWideRad) {
    add({LensModel::kPinhole, LensModel::kBrown1, LensModel::kBrown2, LensModel::kBrown4, LensModel::kBrown5,
         LensModel::kRational8, LensModel::kThinPrism12});
  }
  if (angle > kWideRad) {
    add({LensModel::kUcm, LensModel::kEucm, LensModel::kDoubleSphere, LensModel::kUcmP, LensModel::kKannalaBrandt4,
         LensModel::kEucmP, LensModel::kDoubleSphereP, LensModel::kKannalaBrandt4P});
  }
  if (angle > kWideRad && LargestNumCorners(pool) >= kMinSplineCorners) {
    for (const LensConfig& config : SplinedConfigs(pool)) models.push_back(config);
  }
  return models;
}

std::vector<LensConfig> Configurations(const LensPool& pool, const SelectionOptions& options) {
  const int cameras = static_cast<int>(pool.state.cameras.size());
  std::vector<LensConfig> configs = options.only;
  for (LensConfig& config : configs) config.warp = options.warp, config.stretch = options.stretch;
  if (!configs.empty()) return configs;
  for (LensConfig config : options.models.empty() ? Models(pool) : options.models) {
    config.warp = options.warp, config.stretch = options.stretch;
    if (options.separate || cameras == 1) configs.push_back(config);
    config.shared = true;
    if (options.sharing && cameras > 1) configs.push_back(config);
  }
  std::stable_sort(configs.begin(), configs.end(), [&](const LensConfig& a, const LensConfig& b) {
    return NumLensParams(a, cameras) < NumLensParams(b, cameras);
  });
  return configs;
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

bool EnoughViews(const LensPool& pool) {
  std::vector<int> views(pool.state.cameras.size(), 0);
  for (const View& view : pool.views) ++views[view.camera_idx];
  return static_cast<int>(pool.views.size()) >= kMinViews && *std::min_element(views.begin(), views.end()) >= kMinViewsOfCamera;
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

/// Held-out errors hardly see a wrong focal length, for the boards' poses make up for it; the cameras' own lenses do. When
/// these lie apart by more than their uncertainty, sharing is off, unless it makes the held-out error clearly smaller: with few
/// boards a camera, one good lens for all beats a bad one for each.
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

}  // namespace

std::vector<LensConfig> SplinedConfigs(const LensPool& pool) {
  constexpr double kMargin = 1.05;
  const geometry::Camera& camera = pool.state.cameras[0];
  const double aspect = static_cast<double>(camera.height_px) / camera.width_px;
  const int field_deg = std::clamp(static_cast<int>(std::ceil(2 * kMargin * LargestAngleOf(pool) * 180 / M_PI)), 30, 300);
  std::vector<LensConfig> configs;
  for (int cols : {8, 11, 16}) {
    const int rows = std::max(5, static_cast<int>(std::lround(cols * aspect)));
    configs.push_back({LensModel::kSplined, {3, cols, rows, field_deg}, false, false});
  }
  return configs;
}

LensChoice ChooseLens(const LensPool& pool, const SelectionOptions& options, const BundleOptions& bundle,
                      const RunContext& run) {
  LensChoice choice;
  choice.reason = std::string(geometry::ToString(pool.state.cameras[0].model)) + ": too few views to compare lens models";
  if (!EnoughViews(pool)) return choice;
  const std::vector<LensConfig> configs = Configurations(pool, options);
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
  if (!EnoughViews(pool)) return choice;
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
