#include "stages/budget/model.h"

#include <algorithm>
#include <cmath>

namespace mvstudio::stages {
namespace {

constexpr double kTimingNoise = 0.05;  // of two runs of the same work on a machine that does nothing else

/// Sums over the rows, each divided by its value.
struct TermSums {
  double count = 0, first = 0, second = 0, first_squared = 0, second_squared = 0, product = 0;

  /// Of the squared relative residuals.
  double Misfit(double a, double b) const {
    return count - 2 * (a * first + b * second) + a * a * first_squared + 2 * a * b * product + b * b * second_squared;
  }
};

TermSums SumUp(const std::vector<TermRow>& rows) {
  TermSums sums;
  for (const TermRow& row : rows) {
    const double a = row.first / row.value, b = row.second / row.value;
    ++sums.count, sums.first += a, sums.second += b;
    sums.first_squared += a * a, sums.second_squared += b * b, sums.product += a * b;
  }
  return sums;
}

/// With its covariance for a relative noise of 1; false where a factor is below 0 or not determined.
bool FitBoth(const TermSums& sums, TermFit* fit) {
  const double determinant = sums.first_squared * sums.second_squared - sums.product * sums.product;
  if (!(determinant > 1e-9 * sums.first_squared * sums.second_squared)) return false;
  fit->first = (sums.second_squared * sums.first - sums.product * sums.second) / determinant;
  fit->second = (sums.first_squared * sums.second - sums.product * sums.first) / determinant;
  fit->variance_first = sums.second_squared / determinant, fit->variance_second = sums.first_squared / determinant;
  fit->covariance = -sums.product / determinant;
  return fit->first >= 0 && fit->second >= 0;
}

TermFit FitOne(const TermSums& sums) {
  TermFit first, second;
  first.first = sums.first / sums.first_squared, first.variance_first = 1 / sums.first_squared, first.second = 0;
  second.second = sums.second / sums.second_squared, second.variance_second = 1 / sums.second_squared, second.first = 0;
  if (!(sums.second_squared > 0)) return first;
  if (!(sums.first_squared > 0)) return second;
  const double clear = 1e-9 * sums.count;
  return sums.Misfit(first.first, 0) + clear < sums.Misfit(0, second.second) ? first : second;
}

}  // namespace

Foretold TermFit::At(double first_term, double second_term) const {
  const double variance = first_term * first_term * variance_first + second_term * second_term * variance_second +
                          2 * first_term * second_term * covariance;
  return {first * first_term + second * second_term, std::sqrt(std::max(variance, 0.0))};
}

TermFit FitTerms(const std::vector<TermRow>& rows, double usual_noise) {
  TermFit fit;
  if (rows.empty()) return fit;
  const TermSums sums = SumUp(rows);
  double free = 2;
  if (!FitBoth(sums, &fit)) fit = FitOne(sums), free = 1;
  const double left = std::max(sums.count - free, 0.0), misfit = std::max(sums.Misfit(fit.first, fit.second), 0.0);
  const double noise_squared = (usual_noise * usual_noise + misfit) / (1 + left);
  fit.variance_first *= noise_squared, fit.variance_second *= noise_squared, fit.covariance *= noise_squared;
  return fit;
}

Foretold ForetellSeconds(const std::vector<WorkPart>& parts, double size) {
  Foretold sum{0, 0};
  double variance = 0;
  for (const WorkPart& part : parts) {
    std::vector<TermRow> rows;
    for (const SizedTiming& timing : part.timings)
      rows.push_back({1, std::min(timing.size, part.most_size), std::max(timing.seconds, 1e-9)});
    const Foretold seconds = FitTerms(rows, kTimingNoise).At(1, std::min(size, part.most_size));
    sum.value += seconds.value, variance += seconds.sigma * seconds.sigma;
  }
  sum.sigma = std::sqrt(variance);
  return sum;
}

Foretold ForetellError(const std::vector<SizedError>& errors, double size) {
  constexpr double kSameSize = 1e-6, kErrorNoise = 0.1;
  std::vector<TermRow> rows;
  for (const SizedError& measured : errors) {
    if (!std::isfinite(measured.error) || measured.error <= 0) continue;
    if (std::abs(measured.size - size) <= kSameSize * size) return {measured.error, kErrorNoise * measured.error};
    rows.push_back({1, 1 / measured.size, measured.error * measured.error});
  }
  if (rows.size() == 1) return {std::sqrt(rows[0].value), kErrorNoise * std::sqrt(rows[0].value)};
  const Foretold squared = FitTerms(rows, 2 * kErrorNoise).At(1, 1 / size);
  const double error = std::sqrt(squared.value);
  return {error, std::isfinite(error) && error > 0 ? squared.sigma / (2 * error) : 0};
}

}  // namespace mvstudio::stages
