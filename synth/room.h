#pragma once

#include <Eigen/Core>
#include <cstdint>

namespace mvstudio::synth {

/// The empty studio: a floor at z = 0 inside a round wall, with mild texture or plain.
struct Room {
  bool textured = true;
  uint64_t seed = 1;

  /// Colour 0..255 at which a ray from inside ends.
  Eigen::Vector3f Color(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction) const;
};

}  // namespace mvstudio::synth
