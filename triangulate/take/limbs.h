#pragma once

#include <utility>
#include <vector>

#include "triangulate/take/take.h"

namespace mvstudio::triangulate {

/// Length of one limb of one person over a take.
struct LimbLength {
  int person = 0, limb = 0;
  int num_frames = 0;  ///< in which both joints have a point
  double mean_m = 0;
  double std_m = 0;  ///< standard deviation of the sample (over num_frames); 0 for a rigid bone
};

/// One entry per person and limb (a pair of joints) that at least two frames show.
std::vector<LimbLength> MeasureLimbs(const std::vector<TakePoint>& points, const std::vector<std::pair<int, int>>& limbs);

/// The lengths over both parts of a take.
std::vector<LimbLength> MergeLimbs(const std::vector<LimbLength>& a, const std::vector<LimbLength>& b);

/// Mean of the standard deviations; NaN when there are none.
double MeanLimbStd(const std::vector<LimbLength>& lengths);

}  // namespace mvstudio::triangulate
