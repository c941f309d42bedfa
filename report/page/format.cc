#include "report/page/format.h"

#include <algorithm>
#include <cmath>

#include "core/format.h"

namespace mvstudio::report {
namespace {

void ReplaceAll(std::string* text, const std::string& from, const std::string& to) {
  for (size_t at = text->find(from); at != std::string::npos; at = text->find(from, at + to.size()))
    text->replace(at, from.size(), to);
}

}  // namespace

std::string FormatFixed(double value, int decimals) {
  if (!std::isfinite(value)) return kNoNumber;
  std::string text = Format("%.*f", decimals, value);
  if (text.find_first_not_of("-0.") == std::string::npos && text[0] == '-') text.erase(0, 1);
  return text;
}

std::string FormatWithin(double value, double sigma) {
  return FormatFixed(value, std::clamp(1 - static_cast<int>(std::floor(std::log10(sigma))), 0, 6));
}

std::string FormatNumber(double value, int significant) {
  if (!std::isfinite(value)) return kNoNumber;
  if (value == 0) return "0";
  const double magnitude = std::fabs(value);
  if (magnitude >= 1e7 || magnitude < 1e-4) return Format("%.*e", std::min(significant, 3) - 1, value);
  if (value == std::floor(value) && magnitude < 1e6) return FormatFixed(value, 0);
  const int decimals = std::max(0, significant - 1 - static_cast<int>(std::floor(std::log10(magnitude))));
  std::string text = FormatFixed(value, decimals);
  if (text.find('.') == std::string::npos) return text;
  text.erase(text.find_last_not_of('0') + 1);
  if (text.back() == '.') text.pop_back();
  return text;
}

std::string FormatCount(double value) {
  std::string digits = FormatFixed(value, 0);
  if (!std::isfinite(value)) return digits;
  for (int at = static_cast<int>(digits.size()) - 3; at > (value < 0 ? 1 : 0); at -= 3) digits.insert(at, "\u202f");
  return digits;
}

std::string FormatWithUnit(double value, const std::string& unit, int significant) {
  const std::string number = FormatNumber(value, significant);
  if (!std::isfinite(value) || unit.empty()) return number;
  return number + (unit == "%" || unit == "\u00b0" ? "" : "\u00a0") + unit;
}

std::string FormatDuration(double seconds) {
  if (!std::isfinite(seconds)) return kNoNumber;
  if (seconds < 1) return FormatFixed(seconds * 1e3, 0) + "\u00a0ms";
  if (seconds < 60) return FormatFixed(seconds, seconds < 10 ? 2 : 1) + "\u00a0s";
  const long long whole = std::llround(seconds);
  if (whole < 3600) return std::to_string(whole / 60) + "\u00a0min\u00a0" + std::to_string(whole % 60) + "\u00a0s";
  return std::to_string(whole / 3600) + "\u00a0h\u00a0" + std::to_string(whole % 3600 / 60) + "\u00a0min";
}

KeyLabel LabelOfKey(const std::string& key) {
  static const std::pair<const char*, const char*> kUnits[] = {
      {"_px", "px"}, {"_mm", "mm"}, {"_cm", "cm"}, {"_deg", "\u00b0"}, {"_db", "dB"},   {"_ms", "ms"},
      {"_mb", "MB"}, {"_hz", "Hz"}, {"_m", "m"},   {"_percent", "%"},  {"_rad", "rad"}, {"_s", "s"}};
  KeyLabel result{key, ""};
  const bool is_rate = key.size() > 6 && key.compare(key.size() - 6, 6, "_per_s") == 0;
  if (is_rate) result.label += "econd";
  if (key == "it_per_s") result.label = "steps per second";
  for (const auto& [suffix, unit] : kUnits) {
    const std::string end = suffix;
    if (is_rate || key.size() <= end.size() || key.compare(key.size() - end.size(), end.size(), end) != 0) continue;
    result = {key.substr(0, key.size() - end.size()), unit};
    break;
  }
  if (result.label.rfind("num_", 0) == 0) result.label = result.label.substr(4);
  ReplaceAll(&result.label, "holdout", "held-out");
  ReplaceAll(&result.label, "picture", "image");
  std::replace(result.label.begin(), result.label.end(), '_', ' ');
  return result;
}

}  // namespace mvstudio::report
