#pragma once

#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include "core/choice/option_group.h"

/// What may be spent, and what error is enough.
namespace mvstudio::stages {

/// Seconds of "90s", "5min", "1h30min" or "250ms": whole or decimal numbers, each with its unit, the larger units first. Throws
/// UsageError.
double ParseSeconds(const std::string& text, const std::string& option);
/// "1h 30min", "4.2s".
std::string SecondsText(double seconds);

enum class ErrorUnit { kPx, kMm, kPercent, kSsim };  ///< kSsim: the error is 1 - SSIM
std::string_view ToString(ErrorUnit unit);           ///< "px", "mm", "%", "1 - SSIM"

struct ErrorTarget {
  double value = 0;
  ErrorUnit unit = ErrorUnit::kPx;
};
/// "0.2px", "1mm", "0.5cm", "0.001m", "12%"; "0.85ssim" is an error of 0.15. Throws UsageError.
ErrorTarget ParseTarget(const std::string& text, const std::string& option);

struct BudgetOptions {
  std::string budget, target;               ///< empty: not asked for
  std::function<double()> now_s = nullptr;  ///< a steady clock; null: the system's

  bool Asked() const { return !budget.empty() || !target.empty(); }
  double BudgetSeconds() const;  ///< infinite unless asked for
  std::optional<ErrorTarget> Target() const;
  double NowSeconds() const;
};

/// `target_help`: what an error means to the command.
template <class Visitor>
void VisitBudget(Visitor&& visit, BudgetOptions& o, const std::string& target_help) {
  StartGroup(visit, "Budget");
  visit("budget", o.budget,
        "time that the command may take, e.g. 90s, 5min, 1h30min: a trial on part of the data chooses among the settings that "
        "were not given");
  visit("target", o.target, target_help);
}

}  // namespace mvstudio::stages
