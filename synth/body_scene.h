#pragma once

#include <array>
#include <memory>

#include "avatar/body/body_template.h"
#include "avatar/body/mesh_raster.h"
#include "core/image.h"
#include "geometry/rig/rig.h"
#include "synth/lens_rays.h"

namespace mvstudio::synth {

/// A posed person for ray casting (Embree). Rendering is const and may be called from several threads.
class BodyScene {
 public:
  /// `body` and `textures` must outlive the scene. `vertices_in_world`: (3, V). `two_sided`: for open surfaces, whose inside is
  /// lit as its outside is.
  BodyScene(const body::BodyTemplate& body, const std::array<Image, body::kNumParts>& textures,
            const Eigen::Matrix3Xf& vertices_in_world, bool two_sided = false);
  ~BodyScene();
  BodyScene(const BodyScene&) = delete;
  BodyScene& operator=(const BodyScene&) = delete;

  /// The first intersection of the ray through the centre of a pixel.
  struct Truth {
    std::vector<uint8_t> part;  // (H, W), 0 where the person is not
    std::vector<uint8_t> u, v;  // (H, W), chart coordinates times 255
  };

  /// Draws the person over `image`, `samples` x `samples` samples per pixel, and returns the truth at pixel centres.
  Truth Draw(const geometry::RigCamera& camera, const LensRays& rays, int samples, Image* image) const;

  /// Thickness of body, metres, between the first surface and the point as seen from `origin`; 0 when nothing is in front.
  double DepthBehindSurface(const Eigen::Vector3d& origin, const Eigen::Vector3d& x_in_world) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace mvstudio::synth
