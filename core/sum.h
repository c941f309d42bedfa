#pragma once

#include <cmath>

namespace mvstudio {

/// A sum that keeps what each addition rounds away: of n terms, right to a few roundings and n^2 times the square of one.
/// Neumaier, "Rundungsfehleranalyse einiger Verfahren zur Summation endlicher Summen", ZAMM 1974. Infinite and NaN terms give
/// what plain addition gives.
class Sum {
 public:
  void Add(double term) {
    const double sum = sum_ + term;
    if (std::isfinite(sum)) lost_ += std::abs(sum_) >= std::abs(term) ? (sum_ - sum) + term : (term - sum) + sum_;
    sum_ = sum;
  }
  double value() const { return sum_ + lost_; }

 private:
  double sum_ = 0, lost_ = 0;
};

}  // namespace mvstudio
