#include "core/choice/heldout_choice.h"

#include <algorithm>
#include <cmath>

#include "core/check.h"
#include "core/format.h"

namespace mvstudio {

UnitMean MeanOverUnits(const std::vector<double>& units) {
  double sum = 0, squares = 0;
  int n = 0;
  for (const double value : units) {
    if (!std::isnan(value)) sum += value, squares += value * value, ++n;
  }
  if (n == 0) return {std::numeric_limits<double>::quiet_NaN(), 0, 0};
  const double mean = sum / n;
  // The difference of two sums cancels where the error is 1e-8 of the mean: no rule asks for so many standard errors.
  return {mean, n < 2 ? 0 : std::sqrt(std::max(0.0, squares / n - mean * mean) / (n - 1)), n};
}

UnitMean DifferenceOverUnits(const std::vector<double>& a, const std::vector<double>& b) {
  std::vector<double> differences(std::min(a.size(), b.size()));
  std::transform(a.begin(), a.begin() + static_cast<std::ptrdiff_t>(differences.size()), b.begin(), differences.begin(),
                 [](double x, double y) { return x == y ? 0 : x - y; });
  return MeanOverUnits(differences);
}

UnitMean DifferenceOfMeans(const UnitMean& a, const UnitMean& b) {
  return {a.mean - b.mean, std::hypot(a.standard_error, b.standard_error), std::min(a.num_units, b.num_units)};
}

double InStandardErrors(const UnitMean& difference) {
  if (difference.standard_error == 0) return difference.mean > 0 ? std::numeric_limits<double>::infinity() : 0;
  return difference.mean / difference.standard_error;
}

bool IsAsGood(const UnitMean& worse_by, const HeldOutRule& rule, double loss, double best_loss) {
  if (worse_by.num_units < rule.min_units) return true;
  const auto within = [&worse_by](double standard_errors) {
    return std::isfinite(worse_by.standard_error) && worse_by.mean <= standard_errors * worse_by.standard_error;
  };
  if (within(rule.standard_errors)) return true;
  const bool small = worse_by.mean <= rule.absolute || loss <= (1 + rule.relative) * best_loss;
  return small && (std::isinf(rule.beyond_doubt) || within(rule.beyond_doubt));
}

double MeanLoss(const std::vector<double>& units) {
  const UnitMean mean = MeanOverUnits(units);
  return mean.num_units > 0 ? mean.mean : std::numeric_limits<double>::infinity();
}

std::string HeldOutReason(const std::vector<HeldOutCandidate>& candidates, const HeldOutChoice& choice, int chosen) {
  const std::string &name = candidates[static_cast<size_t>(chosen)].name,
                    &best = candidates[static_cast<size_t>(choice.best)].name;
  const HeldOutVerdict& verdict = choice.verdicts[static_cast<size_t>(chosen)];
  const double best_loss = choice.verdicts[static_cast<size_t>(choice.best)].loss;
  const UnitMean& by = verdict.worse_by;
  if (choice.status != Status::kOk) return Format("%s: %d units held out, too few to choose by", name.c_str(), by.num_units);
  if (chosen == choice.best) return name + " has the smallest held-out error of all tried";
  return Format("%s is the simplest as good as the best (%s): held-out error %+.1f %%, difference %.2g +- %.2g over %d units",
                name.c_str(), best.c_str(), 100 * (verdict.loss - best_loss) / std::abs(best_loss), by.mean, by.standard_error,
                by.num_units);
}

HeldOutChoice ChooseHeldOut(const std::vector<HeldOutCandidate>& candidates, const HeldOutRule& rule) {
  MVS_CHECK(!candidates.empty(), "nothing to choose from");
  HeldOutChoice choice;
  for (const HeldOutCandidate& candidate : candidates)
    choice.verdicts.push_back({std::isnan(candidate.loss) ? MeanLoss(candidate.units) : candidate.loss, {}, false});
  const auto best = std::min_element(choice.verdicts.begin(), choice.verdicts.end(),
                                     [](const auto& a, const auto& b) { return a.loss < b.loss; });
  choice.best = choice.index = static_cast<int>(best - choice.verdicts.begin());
  for (size_t i = candidates.size(); i-- > 0;) {
    HeldOutVerdict& verdict = choice.verdicts[i];
    verdict.worse_by = DifferenceOverUnits(candidates[i].units, candidates[static_cast<size_t>(choice.best)].units);
    const bool predicts = std::isfinite(verdict.loss) || !std::isfinite(best->loss);
    verdict.as_good = &verdict == &*best || (predicts && IsAsGood(verdict.worse_by, rule, verdict.loss, best->loss));
    if (verdict.as_good) choice.index = static_cast<int>(i);
  }
  if (best->worse_by.num_units < rule.min_units || !std::isfinite(best->loss)) choice.status = Status::kTooFewViews;
  choice.reason = HeldOutReason(candidates, choice, choice.index);
  return choice;
}

}  // namespace mvstudio
