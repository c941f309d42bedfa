#pragma once

#include <Eigen/Core>

#include "geometry/lens/camera.h"
#include "geometry/lens/models/lens_base.h"

namespace mvstudio::geometry {

/// Projection by the lens's formula alone, without the valid radius (optimisers may pass through regions that Projector
/// refuses). False where the formula is undefined or the pixel is not finite. `derivatives` may be null.
bool ProjectLens(const Camera& camera, const Eigen::Vector3d& x_in_cam, Eigen::Vector2d* px, LensDerivatives* derivatives);

}  // namespace mvstudio::geometry
