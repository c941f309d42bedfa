#pragma once

#include <algorithm>
#include <limits>
#include <vector>

namespace mvstudio {

/// The upper median: of an even number of values the larger of the two in the middle, so that it is always one of them.
/// Reorders [begin, end), which must hold at least one value and no NaN.
template <class Iterator>
auto UpperMedian(Iterator begin, Iterator end) {
  const auto middle = begin + (end - begin) / 2;
  std::nth_element(begin, middle, end);
  return *middle;
}

/// The same of a vector; `of_none` (NaN where the type has one) when it is empty.
template <class T>
T UpperMedian(std::vector<T> values, typename std::vector<T>::value_type of_none = std::numeric_limits<T>::quiet_NaN()) {
  return values.empty() ? of_none : UpperMedian(values.begin(), values.end());
}

}  // namespace mvstudio
