#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace mvstudio::triangulate {

/// Coordinates that are no pixels count from `low` to `high` over the image: 0 to 1, -1 to 1 (OpenPose's keypoint_scale 4), or
/// percent (Label Studio).
struct ShareRange {
  double low = 0, high = 1;

  double Share(double coordinate) const { return (coordinate - low) / (high - low); }
};

/// The coordinates that a camera has, of x and of y.
struct Coordinates {
  double least = INFINITY, most = -INFINITY;
  int64_t num = 0, num_negative = 0;

  void Add(double coordinate) {
    least = std::min(least, coordinate), most = std::max(most, coordinate);
    ++num, num_negative += coordinate < 0;
  }
  /// People may reach beyond the image, but with a few of their joints.
  ShareRange Range() const {
    if (most > 1.5 && most <= 105 && least >= -5) return {0, 100};
    return {5 * num_negative > num ? -1. : 0., 1};
  }
};

}  // namespace mvstudio::triangulate
