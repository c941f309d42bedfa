#pragma once

#include <chrono>
#include <string>
#include <vector>

namespace mvstudio::avatar {

/// A Markdown page that grows line by line on standard output, and what of it failed.
class Report {
 public:
  explicit Report(double seconds) : seconds_(seconds) {}

  /// A heading and a table's first two lines.
  void Table(const std::string& title, const std::vector<std::string>& columns);
  void Row(const std::vector<std::string>& cells);
  void Line(const std::string& text);
  /// A row of the table of checks: whether the error is within the bound.
  void Check(const std::string& what, const std::string& of, double error, double bound);
  /// "ok" or "**off**", and counts it.
  std::string Verdict(bool fine);
  /// False when the time is up, which the page then says.
  bool TimeFor(const std::string& what);

  int checks() const { return checks_; }
  int failed() const { return failed_; }
  bool complete() const { return skipped_ == 0; }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
  double seconds_;
  int checks_ = 0, failed_ = 0, skipped_ = 0;
};

/// Numbers as text: "1.2e-05", "12.3".
std::string Scientific(double value);
std::string Fixed(double value, int digits);

/// Seconds that work takes.
template <class Work>
double Seconds(const Work& work) {
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

}  // namespace mvstudio::avatar
