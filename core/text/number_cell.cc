#include "core/text/number_cell.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <limits>

namespace mvstudio {
namespace {

std::string_view TrimmedCell(std::string_view text) {
  const size_t first = text.find_first_not_of(" \t\r");
  return first == std::string_view::npos ? std::string_view() : text.substr(first, text.find_last_not_of(" \t\r") + 1 - first);
}

bool SaysMissing(std::string_view text) {
  constexpr size_t kLongest = 16;
  if (text.empty()) return true;
  if (text.size() > kLongest) return false;
  std::string lower(text);
  std::transform(lower.begin(), lower.end(), lower.begin(), [](unsigned char c) { return std::tolower(c); });
  for (const char* word : {"nan", "na", "n/a", "#n/a", "<na>", "null", "none", "nil", "inf", "infinity"}) {
    if (lower == word) return true;
  }
  const bool sign = lower[0] == '-' || lower[0] == '+';
  const std::string bare = lower.substr(sign);
  return sign && (bare == "inf" || bare == "infinity" || bare == "nan");
}

}  // namespace

NumberCell ReadNumberCell(std::string_view text) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  text = TrimmedCell(text);
  if (SaysMissing(text)) return {NumberCell::Kind::kMissing, kNone};
  if (text.size() > 1 && text[0] == '+' && text[1] != '-') text.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  const bool whole = error == std::errc() && end == text.data() + text.size() && std::isfinite(value);
  return whole ? NumberCell{NumberCell::Kind::kNumber, value} : NumberCell{NumberCell::Kind::kOther, kNone};
}

std::optional<int> WholeNumberCell(std::string_view text, int most) {
  const NumberCell cell = ReadNumberCell(text);
  const bool fits = cell.kind == NumberCell::Kind::kNumber && cell.value >= 0 && cell.value <= most;
  if (!fits || cell.value != std::floor(cell.value)) return std::nullopt;
  return static_cast<int>(cell.value);
}

}  // namespace mvstudio
