#pragma once

#include <Eigen/Core>

#include "core/image.h"
#include "geometry/rig/rig.h"
#include "stages/view/solids.h"

namespace mvstudio::stages {

/// Draws a body as a tint with its outline, and boards as an outline, their corners and their axes (x red, y green), through
/// the lens. `scale`: pixels of `tile` in one of the camera, along x and y; edges go to edges. What the lens does not see is
/// left out.
void DrawSolids(const SolidsNow& solids, const geometry::RigCamera& camera, const Eigen::Vector2d& scale, Image* tile);

}  // namespace mvstudio::stages
