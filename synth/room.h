#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "core/image.h"
#include "synth/lens_rays.h"

namespace mvstudio::synth {

/// The empty studio: a floor at z = 0 inside a round wall, with mild texture or plain.
struct Room {
  bool textured = true;
  uint64_t seed = 1;

  /// Colour 0..255 that a ray from inside meets.
  Eigen::Vector3f Color(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction) const;
};

/// What a camera sees of the empty studio, `samples` x `samples` samples a pixel.
Image RenderPlate(const Room& room, const LensRays& rays, int samples, int num_threads);

}  // namespace mvstudio::synth
