#pragma once

#include <string>

namespace mvstudio::report {

/// Text for a number that does not exist.
inline constexpr char kNoNumber[] = "\u2013";

/// At most `significant` digits, no superfluous zeros or exponent ("0.2341", "6.3", "1285", "3.1e-06"); kNoNumber when not
/// finite.
std::string FormatNumber(double value, int significant = 4);
std::string FormatFixed(double value, int decimals);
/// As many decimals as leave two digits of `sigma` (> 0), at most 6.
std::string FormatWithin(double value, double sigma);
/// Whole number with thin spaces between thousands.
std::string FormatCount(double value);
/// "4.213 mm"; the bare kNoNumber when not finite. No space before "%" and "°".
std::string FormatWithUnit(double value, const std::string& unit, int significant = 4);
/// "850 ms", "12.3 s", "4 min 5 s", "2 h 3 min".
std::string FormatDuration(double seconds);

/// A key of the JSON contract as a label: "holdout_rms_px" -> {"held-out rms", "px"}.
struct KeyLabel {
  std::string label, unit;
};
KeyLabel LabelOfKey(const std::string& key);

}  // namespace mvstudio::report
