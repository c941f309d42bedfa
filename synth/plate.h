#pragma once

#include <Eigen/Core>
#include <functional>

#include "core/image.h"
#include "synth/lens_rays.h"

namespace mvstudio::synth {

/// Colour 0..255 that the ray from `origin` along `direction` (unit length) meets; called from several threads.
using RayColor = std::function<Eigen::Vector3f(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction)>;

/// What a camera sees of empty surroundings, `samples` x `samples` samples a pixel; black where the lens sees nothing.
Image RenderPlate(const RayColor& color, const LensRays& rays, int samples, int num_threads);

}  // namespace mvstudio::synth
