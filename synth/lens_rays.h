#pragma once

#include <Eigen/Core>
#include <vector>

#include "geometry/rig/rig.h"

namespace mvstudio::synth {

/// Rays of one camera through its exact lens, computed once: unprojected at the corners of all pixels, bilinear within a
/// pixel (the error is below 1e-5 px for ordinary lenses).
class LensRays {
 public:
  explicit LensRays(const geometry::RigCamera& camera, int num_threads = 1);

  /// Ray through (x + dx, y + dy) px, dx and dy in [-0.5, 0.5]: world direction, not normalised; zero where the lens has
  /// no inverse.
  Eigen::Vector3f Direction(int x, int y, double dx, double dy) const {
    const Eigen::Vector3f *top = &corners_[static_cast<size_t>(y) * (width_ + 1) + x], *bottom = top + width_ + 1;
    const float u = static_cast<float>(dx + 0.5), v = static_cast<float>(dy + 0.5);
    if (top[0].isZero() || top[1].isZero() || bottom[0].isZero() || bottom[1].isZero()) return Eigen::Vector3f::Zero();
    return (1 - v) * ((1 - u) * top[0] + u * top[1]) + v * ((1 - u) * bottom[0] + u * bottom[1]);
  }
  const Eigen::Vector3f& origin() const { return origin_; }
  int width() const { return width_; }
  int height() const { return height_; }

 private:
  int width_, height_;
  Eigen::Vector3f origin_;
  std::vector<Eigen::Vector3f> corners_;  // (H + 1, W + 1), in world
};

}  // namespace mvstudio::synth
