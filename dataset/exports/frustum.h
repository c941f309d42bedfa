#pragma once

#include <Eigen/Core>
#include <array>

#include "geometry/rig/rig.h"

namespace mvstudio::exports {

/// Length of the pyramids that represent cameras, metres.
inline constexpr double kFrustumDepthM = 0.3;

/// The centre of projection and the image's corners (top left, top right, bottom right, bottom left) on the rays of the
/// lens, at that distance from it; in cam. A corner without a ray is at the centre.
std::array<Eigen::Vector3d, 5> FrustumInCam(const geometry::Camera& camera);

/// Pairs of indices of its lines.
inline constexpr int kFrustumEdges[8][2] = {{0, 1}, {0, 2}, {0, 3}, {0, 4}, {1, 2}, {2, 3}, {3, 4}, {4, 1}};

}  // namespace mvstudio::exports
