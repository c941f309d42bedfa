#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <string>
#include <string_view>

/// Rows of docs/numerics.md: each is asserted when it is recorded (scripts/numerics).
namespace mvstudio::testing {

/// The most that a double can have.
inline constexpr int kMostDigits = 15;

/// Decimal digits of a result whose relative error is this: whole ones, from 0 to kMostDigits; 0 for an error that is no
/// number.
inline int DigitsOf(double relative_error) {
  const double error = std::abs(relative_error);
  if (!(error < 1)) return 0;
  if (error == 0) return kMostDigits;
  return std::min(kMostDigits, static_cast<int>(std::floor(-std::log10(error))));
}

/// The largest of some relative errors; NaN is the largest of all.
class WorstError {
 public:
  void Add(double error) {
    worst_ = std::isnan(error) || std::isnan(worst_) ? std::nan("") : std::max(worst_, std::abs(error));
  }
  double value() const { return worst_; }

 private:
  double worst_ = 0;
};

/// Appends a row to the file that MVSTUDIO_DIGITS names, if it names one.
inline void AppendRow(const std::string& row) {
  const char* path = std::getenv("MVSTUDIO_DIGITS");
  if (!path || !*path) return;
  std::ofstream file(path, std::ios::app);
  file << row << '\n';
  ASSERT_TRUE(file.good()) << "cannot write to " << path;
}

/// What is measured, under which conditions, and what says what would be right.
struct DigitsCase {
  std::string section, what, conditions, oracle;

  std::string Row() const { return section + '\t' + what + '\t' + conditions + '\t' + oracle; }
};

/// Fails unless the result has `expected` digits.
inline void RecordDigits(const DigitsCase& c, int expected, double relative_error) {
  const int measured = DigitsOf(relative_error);
  EXPECT_GE(measured, expected) << c.what << ", " << c.conditions << ": relative error " << relative_error;
  AppendRow(c.Row() + '\t' + std::to_string(expected) + '\t' + std::to_string(measured));
}

/// Fails unless the status, or another word, is the expected one.
inline void RecordStatus(const DigitsCase& c, std::string_view expected, std::string_view measured) {
  EXPECT_EQ(measured, expected) << c.what << ", " << c.conditions;
  AppendRow(c.Row() + '\t' + std::string(expected) + '\t' + std::string(measured));
}

}  // namespace mvstudio::testing
