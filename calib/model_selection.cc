#include "calib/model_selection.h"

#include <cmath>
#include <cstdio>

namespace mvstudio::calib {
namespace {

using geometry::LensModel;

constexpr LensModel kCandidates[] = {LensModel::kPinhole, LensModel::kBrown1, LensModel::kBrown2,
                                     LensModel::kBrown4,  LensModel::kBrown5, LensModel::kRational8};
constexpr int kMinViews = 6;

/// Whether `simple` is no worse than `best` by more than one standard error of the views' paired differences.
bool WithinOneStandardError(const Holdout& simple, const Holdout& best) {
  double sum = 0, sum_squares = 0;
  int n = 0;
  for (size_t v = 0; v < best.view_mean_square.size(); ++v) {
    const double difference = simple.view_mean_square[v] - best.view_mean_square[v];
    if (std::isnan(best.view_mean_square[v])) continue;
    if (std::isnan(difference)) return false;
    sum += difference, sum_squares += difference * difference, ++n;
  }
  if (n < 2) return true;
  const double mean = sum / n;
  const double variance = std::max(0.0, (sum_squares - n * mean * mean) / (n - 1));
  return mean <= std::sqrt(variance / n);
}

std::string Explain(const ModelChoice& choice, const ModelCandidate& chosen, const ModelCandidate& best) {
  char text[200];
  std::snprintf(text, sizeof text, "%s: held-out error %.3f px, within one standard error of the best (%s, %.3f px)",
                std::string(geometry::ToString(choice.model)).c_str(), chosen.holdout.rms_px,
                std::string(geometry::ToString(best.model)).c_str(), best.holdout.rms_px);
  return text;
}

}  // namespace

ModelChoice ChooseModel(const MonoSolution& solution, int num_folds, int max_views) {
  ModelChoice choice;
  choice.reason = "brown4: too few views to compare lens models";
  if (solution.views.size() < kMinViews) return choice;
  for (LensModel model : kCandidates) choice.candidates.push_back({model, HoldoutError(solution, model, num_folds, max_views), false});
  const ModelCandidate* best = nullptr;
  for (const ModelCandidate& candidate : choice.candidates) {
    if (candidate.holdout.status != Status::kOk) continue;
    if (!best || candidate.holdout.rms_px < best->holdout.rms_px) best = &candidate;
  }
  if (!best) return choice;
  const ModelCandidate* chosen = nullptr;
  for (ModelCandidate& candidate : choice.candidates) {
    candidate.within_one_se = candidate.holdout.status == Status::kOk && WithinOneStandardError(candidate.holdout, best->holdout);
    if (candidate.within_one_se && !chosen) chosen = &candidate;
  }
  if (!chosen) chosen = best;
  choice.model = chosen->model;
  choice.reason = Explain(choice, *chosen, *best);
  return choice;
}

}  // namespace mvstudio::calib
