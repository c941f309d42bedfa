#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "core/image.h"
#include "geometry/rig/rig.h"

namespace mvstudio::body {

/// Vertices in an image.
struct ScreenVertices {
  Eigen::Matrix2Xd px;        ///< (2, V)
  std::vector<uint8_t> seen;  ///< (V) the vertex has an image: it is finite, before the camera, and the lens is defined there
};

/// Vertices (3, V) in world, metres, through the camera's exact lens.
ScreenVertices ProjectVertices(const Eigen::Matrix3Xf& vertices_in_world, const geometry::RigCamera& camera);

/// 255 where a face covers the pixel's centre; faces with a vertex that is not seen are left out.
Image FillFaces(const Eigen::Matrix3Xi& faces, const ScreenVertices& screen, int width_px, int height_px);

}  // namespace mvstudio::body
