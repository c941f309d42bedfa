#pragma once

#include <Eigen/Core>

#include "core/image.h"
#include "geometry/rig/rig.h"
#include "stages/overlay/solids.h"

namespace mvstudio::stages {

/// Draws a body as a tint with its outline, and boards as an outline, their corners and their axes (x red, y green), through
/// the lens. `scale`: pixels of `tile` in one of the camera, along x and y; edges go to edges. What the lens does not see is
/// left out.
void DrawSolids(const SolidsNow& solids, const geometry::RigCamera& camera, const Eigen::Vector2d& scale, Image* tile);

/// 255 in triangles of these corners, 0 elsewhere: pixels whose centre lies inside. `px` (2, V); triangles with a corner that
/// is not finite are left out. Source of the rule: Pineda, "A parallel algorithm for polygon rasterization", SIGGRAPH 1988.
Image TriangleMask(const Eigen::Matrix2Xd& px, const Eigen::Matrix3Xi& faces, int width, int height);

}  // namespace mvstudio::stages
