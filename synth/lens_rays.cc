#include "synth/lens_rays.h"

#include "core/parallel.h"
#include "geometry/lens/camera.h"

namespace mvstudio::synth {

LensRays::LensRays(const geometry::RigCamera& camera, int num_threads)
    : width_(camera.camera.width_px), height_(camera.camera.height_px), origin_(camera.CenterInWorld().cast<float>()) {
  corners_.assign(static_cast<size_t>(width_ + 1) * (height_ + 1), Eigen::Vector3f::Zero());
  const geometry::Projector projector(camera.camera);
  const Eigen::Quaterniond world_from_cam = camera.cam_from_world.rotation.conjugate();
  ParallelFor(height_ + 1, num_threads, [&](int64_t y) {
    for (int x = 0; x <= width_; ++x) {
      const geometry::Unprojection ray = projector.Unproject({x - 0.5, y - 0.5});
      if (ray.status != Status::kOk) continue;
      corners_[static_cast<size_t>(y) * (width_ + 1) + x] = (world_from_cam * ray.ray_in_cam).cast<float>();
    }
  });
}

}  // namespace mvstudio::synth
