#pragma once

#include <Eigen/Core>
#include <cstdint>

namespace mvstudio::synth {

/// An empty room whose walls, floor and ceiling are full of things that features can be found on: patches and posters of all
/// sizes from 60 cm to 3 cm, different everywhere.
struct TexturedRoom {
  Eigen::Vector3f size_m{8, 7, 3.2f};  ///< floor at z = 0, centred on the origin
  uint64_t seed = 1;

  /// Colour 0..255 that a ray from inside meets.
  Eigen::Vector3f Color(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction) const;
};

}  // namespace mvstudio::synth
