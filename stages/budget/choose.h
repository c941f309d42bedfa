#pragma once

#include <cmath>
#include <string>
#include <utility>
#include <vector>

/// Time and error of settings on part of the data, what they predict of all of it, and the setting that is chosen.
namespace mvstudio::stages {

struct SizedTiming {
  double size = 0, seconds = 0;
};

/// seconds = fixed_s + per_unit_s * size, neither below 0.
struct TimeModel {
  double fixed_s = 0, per_unit_s = 0;
  double At(double size) const { return fixed_s + per_unit_s * size; }
};
/// Least squares; of equal sizes the time is taken to grow with the size. NaN of no timings.
TimeModel FitTime(const std::vector<SizedTiming>& timings);

struct SettingTrial {
  std::vector<std::pair<std::string, std::string>> flags;  ///< option and value in which it differs from what was given
  std::vector<SizedTiming> timings;                        ///< empty: not tried
  double error = std::nan(""), error_sigma = 0;            ///< on held-out data; NaN: could not be judged
  double predicted_s = std::nan("");                       ///< of the whole command; NaN: not tried
  std::string why_not;                                     ///< it was not tried

  std::string Name() const;  ///< "option 'refine' on", "the defaults"
};

struct SettingChoice {
  enum class Outcome { kReached, kBestWithinBudget, kNothingFits };
  Outcome outcome = Outcome::kReached;
  int index = 0;  ///< of kNothingFits the cheapest
};

/// With a target the cheapest trial that is within the budget and reaches it; else, and without one, the best within the
/// budget, or the cheapest that is not worse than that one by more than a standard error of their difference. `target`: NaN for
/// none.
SettingChoice ChooseSetting(const std::vector<SettingTrial>& trials, double budget_s, double target);

}  // namespace mvstudio::stages
