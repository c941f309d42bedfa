#pragma once

#include <Eigen/Core>
#include <functional>

#include "core/image.h"
#include "synth/lens_rays.h"

namespace mvstudio::synth {

/// Colour 0..255 of the ray from `origin` along `direction` (unit length); called from several threads.
using RayColor = std::function<Eigen::Vector3f(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction)>;

/// Renders a camera's image of the empty scene, `samples` x `samples` samples per pixel; black where the lens has no ray.
Image RenderPlate(const RayColor& color, const LensRays& rays, int samples, int num_threads);

}  // namespace mvstudio::synth
