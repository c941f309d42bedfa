#pragma once

#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "stages/budget/model.h"

/// Time and error of settings on part of the data, what they predict of all of it, and the setting that is chosen.
namespace mvstudio::stages {

struct SettingTrial {
  std::vector<std::pair<std::string, std::string>> flags;  ///< option and value in which it differs from what was given
  std::string what;                                        ///< what that means here: "15 of 60 images a camera"; may be empty
  double size = std::nan("");                              ///< of the whole work under this setting, in the timings' unit
  std::vector<WorkPart> parts;                             ///< empty: not tried
  double error = std::nan(""), error_sigma = 0;            ///< as a target means it; NaN: could not be judged
  double predicted_s = std::nan("");                       ///< of the whole command; NaN: not tried
  double predicted_sigma_s = 0;
  std::string short_of;    ///< why it reaches no target whatever its error; empty: nothing else is asked of it
  double uncertainty = 0;  ///< of two that are as good, the one with less is taken, of two with the same the cheaper
  std::string why_not;     ///< it was not tried

  bool IsTried() const { return !parts.empty(); }
  std::string Name() const;  ///< "option 'refine' on", "the settings as they are"
};

struct SettingChoice {
  enum class Outcome { kReached, kBestWithinBudget, kNothingFits };
  Outcome outcome = Outcome::kReached;
  int index = 0;  ///< of kNothingFits the cheapest
};

/// Whether a setting that was tried reaches the target: what is dearer for sure need not be tried then. `target`: NaN for none.
bool AnyReaches(const std::vector<SettingTrial>& trials, double target);
/// Why it was not.
inline constexpr char kCheaperReaches[] = "a cheaper setting reaches the target";

/// With a target the cheapest trial that is within the budget and reaches it; else, and without one, the best within the
/// budget, or of those not worse by more than a standard error of their difference that of least uncertainty, then the
/// cheapest. Within the budget is what is predicted to stay below it by a standard deviation. `target`: NaN for none.
SettingChoice ChooseSetting(const std::vector<SettingTrial>& trials, double budget_s, double target);

}  // namespace mvstudio::stages
