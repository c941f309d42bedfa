#pragma once

#include <algorithm>
#include <limits>
#include <utility>
#include <vector>

namespace mvstudio::body {

/// The value that minimises the sum of weight |value - x| over the samples (value, weight): half of the weight lies on each
/// side. Where several do, the middle of them. NaN without samples; weights are positive.
inline double WeightedMedian(std::vector<std::pair<double, double>> samples) {
  if (samples.empty()) return std::numeric_limits<double>::quiet_NaN();
  std::sort(samples.begin(), samples.end());
  double total = 0, below = 0;
  for (const auto& sample : samples) total += sample.second;
  for (size_t i = 0; i + 1 < samples.size(); ++i) {
    below += samples[i].second;
    if (2 * below > total) return samples[i].first;
    if (2 * below == total) return 0.5 * (samples[i].first + samples[i + 1].first);
  }
  return samples.back().first;
}

}  // namespace mvstudio::body
