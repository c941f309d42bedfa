#include "stages/budget/choose.h"

#include <algorithm>
#include <limits>

namespace mvstudio::stages {
namespace {

double JudgedError(const SettingTrial& trial) {
  return std::isnan(trial.error) ? std::numeric_limits<double>::infinity() : trial.error;
}

bool NotWorse(const SettingTrial& trial, const SettingTrial& best) {
  if (std::isinf(JudgedError(best))) return true;
  return JudgedError(trial) - best.error <= std::hypot(trial.error_sigma, best.error_sigma);
}

/// Its place in `trials`, of those that `suits` takes; -1: none.
template <class Suits, class Less>
int FirstBy(const std::vector<SettingTrial>& trials, const Suits& suits, const Less& less) {
  int found = -1;
  for (int i = 0; i < static_cast<int>(trials.size()); ++i) {
    const SettingTrial& trial = trials[static_cast<size_t>(i)];
    if (suits(trial) && (found < 0 || less(trial, trials[static_cast<size_t>(found)]))) found = i;
  }
  return found;
}

}  // namespace

std::string SettingTrial::Name() const {
  std::string text;
  for (const auto& [option, value] : flags) text += (text.empty() ? "option '" : " option '") + option + "' " + value;
  return text.empty() ? "the settings as they are" : text;
}

bool AnyReaches(const std::vector<SettingTrial>& trials, double target) {
  return std::any_of(trials.begin(), trials.end(), [target](const SettingTrial& trial) {
    return trial.IsTried() && trial.short_of.empty() && JudgedError(trial) <= target;
  });
}

SettingChoice ChooseSetting(const std::vector<SettingTrial>& trials, double budget_s, double target) {
  const auto cheaper = [](const SettingTrial& a, const SettingTrial& b) { return a.predicted_s < b.predicted_s; };
  const auto better = [](const SettingTrial& a, const SettingTrial& b) { return JudgedError(a) < JudgedError(b); };
  const auto fits = [&](const SettingTrial& trial) { return trial.predicted_s + trial.predicted_sigma_s <= budget_s; };
  const auto tried = [](const SettingTrial& trial) { return std::isfinite(trial.predicted_s); };
  using Outcome = SettingChoice::Outcome;
  const int best = FirstBy(trials, fits, better);
  if (best < 0) return {Outcome::kNothingFits, std::max(FirstBy(trials, tried, cheaper), 0)};
  if (std::isfinite(target)) {
    const int enough = FirstBy(
        trials, [&](const SettingTrial& t) { return fits(t) && t.short_of.empty() && JudgedError(t) <= target; }, cheaper);
    if (enough >= 0) return {Outcome::kReached, enough};
  }
  const auto as_good = [&](const SettingTrial& t) { return fits(t) && NotWorse(t, trials[static_cast<size_t>(best)]); };
  const auto preferred = [&](const SettingTrial& a, const SettingTrial& b) {
    return a.uncertainty != b.uncertainty ? a.uncertainty < b.uncertainty : cheaper(a, b);
  };
  return {std::isfinite(target) ? Outcome::kBestWithinBudget : Outcome::kReached, FirstBy(trials, as_good, preferred)};
}

}  // namespace mvstudio::stages
