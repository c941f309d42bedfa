#include "synth/plate.h"

#include <algorithm>

#include "core/parallel.h"

namespace mvstudio::synth {

Image RenderPlate(const RayColor& color, const LensRays& rays, int samples, int num_threads) {
  Image plate(rays.width(), rays.height(), 3);
  ParallelFor(rays.height(), num_threads, [&](int64_t y) {
    for (int x = 0; x < rays.width(); ++x) {
      Eigen::Vector3f sum = Eigen::Vector3f::Zero();
      for (int s = 0; s < samples * samples; ++s) {
        const Eigen::Vector3f direction =
            rays.Direction(x, static_cast<int>(y), (s % samples + 0.5) / samples - 0.5, (s / samples + 0.5) / samples - 0.5);
        if (!direction.isZero()) sum += color(rays.origin(), direction);
      }
      uint8_t* pixel = plate.Pixel(x, static_cast<int>(y));
      for (int k = 0; k < 3; ++k) pixel[k] = static_cast<uint8_t>(std::clamp(sum[k] / (samples * samples) + 0.5f, 0.f, 255.f));
    }
  });
  return plate;
}

}  // namespace mvstudio::synth
