#include "calib/model_selection.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "core/parallel.h"

namespace mvstudio::calib {
namespace {

using geometry::LensModel;

constexpr LensModel kCandidates[] = {LensModel::kPinhole, LensModel::kBrown1, LensModel::kBrown2,
                                     LensModel::kBrown4,  LensModel::kBrown5, LensModel::kRational8};
constexpr int kNumCandidates = sizeof kCandidates / sizeof kCandidates[0];
constexpr size_t kMinViews = 6;

/// Smallest mean square of each camera over the candidates, px^2.
std::vector<double> BestMeanSquares(const std::vector<ModelCandidate>& candidates, size_t num_cameras) {
  std::vector<double> best(num_cameras, std::numeric_limits<double>::infinity());
  for (const ModelCandidate& candidate : candidates) {
    for (size_t c = 0; c < num_cameras; ++c) {
      const Holdout& holdout = candidate.holdouts[c];
      if (holdout.status == Status::kOk) best[c] = std::min(best[c], std::max(1e-18, holdout.rms_px * holdout.rms_px));
    }
  }
  return best;
}

/// Mean squares of all views of all cameras, in units of each camera's smallest. NaN where a view could not be scored.
std::vector<double> Pool(const ModelCandidate& candidate, const std::vector<double>& best) {
  std::vector<double> pooled;
  for (size_t c = 0; c < candidate.holdouts.size(); ++c) {
    for (double mean_square : candidate.holdouts[c].view_mean_square) pooled.push_back(mean_square / best[c]);
  }
  return pooled;
}

/// Mean of the paired differences and its standard error; infinite when `a` could not score a view that `b` could.
struct Difference {
  double mean = 0, standard_error = 0;
};

Difference Compare(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0, squares = 0;
  int n = 0;
  for (size_t v = 0; v < b.size(); ++v) {
    if (std::isnan(b[v])) continue;
    if (std::isnan(a[v])) return {std::numeric_limits<double>::infinity(), 0};
    sum += a[v] - b[v], squares += (a[v] - b[v]) * (a[v] - b[v]), ++n;
  }
  if (n < 2) return {};
  const double mean = sum / n;
  return {mean, std::sqrt(std::max(0.0, squares / n - mean * mean) / (n - 1))};
}

double PooledRms(const std::vector<double>& pooled) {
  double sum = 0;
  int n = 0;
  for (double value : pooled) {
    if (!std::isnan(value)) sum += value, ++n;
  }
  return n ? std::sqrt(sum / n) : std::numeric_limits<double>::infinity();
}

std::string Explain(const ModelCandidate& chosen, const ModelCandidate& best) {
  char text[240];
  const std::string name(geometry::ToString(chosen.model)), best_name(geometry::ToString(best.model));
  if (&chosen == &best) {
    std::snprintf(text, sizeof text, "%s has the smallest held-out error of all lens models tried", name.c_str());
  } else {
    std::snprintf(text, sizeof text,
                  "%s is the simplest lens model within one standard error of the best (%s): held-out error %.1f %% larger",
                  name.c_str(), best_name.c_str(), 100 * (chosen.relative_error / best.relative_error - 1));
  }
  return text;
}

void Select(ModelChoice* choice) {
  const std::vector<double> scale = BestMeanSquares(choice->candidates, choice->candidates[0].holdouts.size());
  std::vector<std::vector<double>> pooled;
  for (ModelCandidate& candidate : choice->candidates) {
    pooled.push_back(Pool(candidate, scale));
    candidate.relative_error = PooledRms(pooled.back());
  }
  const auto best = std::min_element(choice->candidates.begin(), choice->candidates.end(),
                                     [](const auto& a, const auto& b) { return a.relative_error < b.relative_error; });
  if (!std::isfinite(best->relative_error)) return;
  for (size_t i = 0; i < choice->candidates.size(); ++i) {
    const Difference difference = Compare(pooled[i], pooled[best - choice->candidates.begin()]);
    choice->candidates[i].within_one_se = difference.mean <= difference.standard_error;
    if (choice->index < 0 && choice->candidates[i].within_one_se) choice->index = static_cast<int>(i);
  }
  if (choice->index < 0) choice->index = static_cast<int>(best - choice->candidates.begin());
  choice->model = choice->candidates[choice->index].model;
  choice->reason = Explain(choice->candidates[choice->index], *best);
}

}  // namespace

ModelChoice ChooseModel(const std::vector<MonoSolution>& solutions, int num_folds, int max_views, int num_threads) {
  ModelChoice choice;
  choice.reason = "brown4: too few views to compare lens models";
  size_t fewest = std::numeric_limits<size_t>::max();
  for (const MonoSolution& solution : solutions) fewest = std::min(fewest, solution.views.size());
  if (solutions.empty() || fewest < kMinViews) return choice;
  const size_t num_cameras = solutions.size();
  for (LensModel model : kCandidates) choice.candidates.push_back({model, std::vector<Holdout>(num_cameras), 0, false});
  ParallelFor(static_cast<int64_t>(num_cameras) * kNumCandidates, num_threads, [&](int64_t i) {
    ModelCandidate& candidate = choice.candidates[i % kNumCandidates];
    const int64_t camera = i / kNumCandidates;
    candidate.holdouts[camera] = HoldoutError(solutions[camera], candidate.model, num_folds, max_views);
  });
  Select(&choice);
  return choice;
}

}  // namespace mvstudio::calib
