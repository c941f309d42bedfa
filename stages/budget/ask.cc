#include "stages/budget/ask.h"

#include <chrono>
#include <cmath>
#include <limits>

#include "core/error.h"
#include "core/format.h"
#include "core/text/number_cell.h"

namespace mvstudio::stages {
namespace {

struct AmountUnit {
  std::string_view name;
  double factor;
};

constexpr AmountUnit kTimeUnits[] = {{"h", 3600}, {"min", 60}, {"s", 1}, {"ms", 1e-3}};

/// The number and its unit at the start of `text`, which is shortened by them; an empty unit where there is none.
std::pair<double, std::string_view> TakeAmount(std::string_view* text) {
  const size_t digits = std::min(text->find_first_not_of("0123456789."), text->size());
  const NumberCell number = ReadNumberCell(text->substr(0, digits));
  const size_t end = std::min(text->find_first_of("0123456789.", digits), text->size());
  const std::string_view unit = text->substr(digits, end - digits);
  text->remove_prefix(end);
  const bool positive = number.kind == NumberCell::Kind::kNumber && std::isfinite(number.value);
  return {positive ? number.value : std::nan(""), unit};
}

}  // namespace

double ParseSeconds(const std::string& text, const std::string& option) {
  const UsageError refusal("option '" + option + "' '" + text +
                           "': expected a time above 0 with units, the larger ones first, such as 90s, 5min or 1h30min");
  std::string_view rest = text;
  double seconds = 0;
  const AmountUnit* next = std::begin(kTimeUnits);
  while (!rest.empty()) {
    const auto [value, unit] = TakeAmount(&rest);
    while (next != std::end(kTimeUnits) && next->name != unit) ++next;
    if (next == std::end(kTimeUnits) || !std::isfinite(value)) throw refusal;
    seconds += value * next++->factor;
  }
  if (!(seconds > 0) || !std::isfinite(seconds)) throw refusal;
  return seconds;
}

std::string SecondsText(double seconds) {
  if (!std::isfinite(seconds)) return "unknown time";
  if (seconds < 9.95) return Format("%.1fs", seconds);
  const long long whole = std::llround(std::min(seconds, 1e15));
  if (whole < 60) return Format("%lds", static_cast<long>(whole));
  if (whole < 3600) return Format("%ldmin %lds", static_cast<long>(whole / 60), static_cast<long>(whole % 60));
  return Format("%ldh %ldmin", static_cast<long>(whole / 3600), static_cast<long>(whole % 3600 / 60));
}

std::string_view ToString(ErrorUnit unit) {
  if (unit == ErrorUnit::kPercent) return "%";
  if (unit == ErrorUnit::kSsim) return "1 - SSIM";
  return unit == ErrorUnit::kPx ? "px" : "mm";
}

ErrorTarget ParseTarget(const std::string& text, const std::string& option) {
  constexpr AmountUnit kLengths[] = {{"mm", 1}, {"cm", 10}, {"m", 1000}};
  std::string_view rest = text;
  const auto [value, unit] = TakeAmount(&rest);
  if (rest.empty() && value > 0) {
    if (unit == "px") return {value, ErrorUnit::kPx};
    if (unit == "%") return {value, ErrorUnit::kPercent};
    if (unit == "ssim" && value < 1) return {1 - value, ErrorUnit::kSsim};
    for (const AmountUnit& length : kLengths) {
      if (unit == length.name && std::isfinite(value * length.factor)) return {value * length.factor, ErrorUnit::kMm};
    }
  }
  throw UsageError("option '" + option + "' '" + text +
                   "': expected an error above 0 with its unit, such as 0.5px or 2mm, or an SSIM below 1, such as 0.85ssim");
}

double BudgetOptions::BudgetSeconds() const {
  return budget.empty() ? std::numeric_limits<double>::infinity() : ParseSeconds(budget, "budget");
}

std::optional<ErrorTarget> BudgetOptions::Target() const {
  if (target.empty()) return std::nullopt;
  return ParseTarget(target, "target");
}

double BudgetOptions::NowSeconds() const {
  if (now_s) return now_s();
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

}  // namespace mvstudio::stages
