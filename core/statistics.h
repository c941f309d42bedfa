#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

/// Medians, quantiles and spread of samples. NaN cannot be ordered: remove it before a median or a quantile
/// (FiniteValues); infinities count. For an empty vector all results are NaN.
namespace mvstudio {

/// Standard deviation of a normal distribution over its median absolute deviation.
inline constexpr double kSigmaPerMad = 1.4826;

/// The sorted values' element at `rank`, 0 being the smallest. Reorders [begin, end), which must hold more than `rank`
/// values.
template <class Iterator>
auto ValueOfRank(Iterator begin, Iterator end, std::ptrdiff_t rank) {
  std::nth_element(begin, begin + rank, end);
  return *(begin + rank);
}

/// The upper median: for an even number of values the larger of the two in the middle, so that it is always one of them.
/// Reorders [begin, end), which must hold at least one value and no NaN.
template <class Iterator>
auto UpperMedian(Iterator begin, Iterator end) {
  return ValueOfRank(begin, end, (end - begin) / 2);
}

/// Same for a vector; `of_none` (NaN where the type has one) when it is empty.
template <class T>
T UpperMedian(std::vector<T> values, typename std::vector<T>::value_type of_none = std::numeric_limits<T>::quiet_NaN()) {
  return values.empty() ? of_none : UpperMedian(values.begin(), values.end());
}

/// Quantiles: `share` 0 gives the smallest value, 1 the largest. The functions differ between two values, hence for few
/// values; only the linear one can return a value that is not in the sample.
///
/// At position share * (n - 1) of the sorted values, interpolated between its neighbours; 0.5 of an even number of values:
/// the mean of the two in the middle.
template <class T>
double LinearQuantile(std::vector<T> values, double share) {
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  const double at = share * static_cast<double>(values.size() - 1);
  const auto low = static_cast<std::ptrdiff_t>(at);
  const double rest = at - static_cast<double>(low), below = ValueOfRank(values.begin(), values.end(), low);
  if (rest == 0) return below;  // not 0 times infinity
  const double above = *std::min_element(values.begin() + low + 1, values.end());
  return (1 - rest) * below + rest * above;
}

/// The value at that position or, between two, the lower one.
template <class T>
T LowerQuantile(std::vector<T> values, double share) {
  if (values.empty()) return std::numeric_limits<T>::quiet_NaN();
  const double at = share * static_cast<double>(values.size() - 1);
  return ValueOfRank(values.begin(), values.end(), static_cast<std::ptrdiff_t>(at));
}

/// The value nearest to that position; halfway between two, the upper one.
template <class T>
T NearestQuantile(std::vector<T> values, double share) {
  if (values.empty()) return std::numeric_limits<T>::quiet_NaN();
  const double at = share * static_cast<double>(values.size() - 1);
  return ValueOfRank(values.begin(), values.end(), static_cast<std::ptrdiff_t>(std::lround(at)));
}

/// The smallest value that at least this share of all values do not exceed; `share` above 0.
template <class T>
T ShareQuantile(std::vector<T> values, double share) {
  if (values.empty()) return std::numeric_limits<T>::quiet_NaN();
  const double count = std::ceil(share * static_cast<double>(values.size()));
  return ValueOfRank(values.begin(), values.end(), static_cast<std::ptrdiff_t>(count) - 1);
}

/// The smallest value that more than this share of all values do not exceed, at 0.5 the upper median; `share` below 1.
template <class T>
T UpperQuantile(std::vector<T> values, double share) {
  if (values.empty()) return std::numeric_limits<T>::quiet_NaN();
  const double at = share * static_cast<double>(values.size());
  return ValueOfRank(values.begin(), values.end(), static_cast<std::ptrdiff_t>(at));
}

/// The values in their order, without NaN and infinities.
template <class T>
std::vector<T> FiniteValues(std::vector<T> values) {
  values.erase(std::remove_if(values.begin(), values.end(), [](T value) { return !std::isfinite(value); }), values.end());
  return values;
}

/// term(begin) + ... + term(end - 1), 64 of them in their order, more by halves: the error grows with the logarithm of the
/// number (Higham, "The accuracy of floating point summation", 1993).
template <class Term>
double PairwiseSum(std::size_t begin, std::size_t end, const Term& term) {
  constexpr std::size_t kInOrder = 64;
  if (end - begin > kInOrder) {
    const std::size_t middle = begin + (end - begin) / 2;
    return PairwiseSum(begin, middle, term) + PairwiseSum(middle, end, term);
  }
  double sum = 0;
  for (std::size_t i = begin; i < end; ++i) sum += term(i);
  return sum;
}

template <class T>
double Mean(const std::vector<T>& values) {
  const double sum = PairwiseSum(0, values.size(), [&](std::size_t i) { return static_cast<double>(values[i]); });
  return values.empty() ? std::numeric_limits<double>::quiet_NaN() : sum / static_cast<double>(values.size());
}

/// Root of the mean square.
inline double Rms(const std::vector<double>& values) {
  const double squares = PairwiseSum(0, values.size(), [&](std::size_t i) { return values[i] * values[i]; });
  return values.empty() ? std::numeric_limits<double>::quiet_NaN() : std::sqrt(squares / static_cast<double>(values.size()));
}

/// Sum of the squared deviations from the mean; 0 for no values.
inline double SquaredDeviations(const std::vector<double>& values) {
  const double mean = Mean(values);
  return PairwiseSum(0, values.size(), [&](std::size_t i) { return (values[i] - mean) * (values[i] - mean); });
}

/// Standard deviation of the sample itself: over n.
inline double PopulationDeviation(const std::vector<double>& values) {
  return std::sqrt(SquaredDeviations(values) / static_cast<double>(values.size()));
}

/// Estimated standard deviation of the population: over n - 1. NaN for fewer than two values.
inline double SampleDeviation(const std::vector<double>& values) {
  if (values.size() < 2) return std::numeric_limits<double>::quiet_NaN();
  return std::sqrt(SquaredDeviations(values) / static_cast<double>(values.size() - 1));
}

}  // namespace mvstudio
