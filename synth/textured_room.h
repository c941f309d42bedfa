#pragma once

#include <Eigen/Core>
#include <cstdint>

namespace mvstudio::synth {

/// An empty room with many image features on walls, floor and ceiling: patches and posters from 60 cm to 3 cm, all
/// different.
struct TexturedRoom {
  Eigen::Vector3f size_m{8, 7, 3.2f};  ///< floor at z = 0, centred on the origin
  uint64_t seed = 1;

  /// Colour 0..255 at which a ray from inside ends.
  Eigen::Vector3f Color(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction) const;
};

}  // namespace mvstudio::synth
