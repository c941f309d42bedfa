#pragma once

#include <Eigen/Core>
#include <vector>

#include "avatar/body/body_template.h"
#include "geometry/rig/rig.h"

namespace mvstudio::body {

/// Rasterized body in a camera's image, one value per pixel, rows from the top.
struct PartUvMap {
  int width = 0, height = 0;
  std::vector<uint8_t> part;   // (H, W) 0 background, 1..24
  std::vector<float> u, v;     // (H, W) chart coordinates in [0, 1], 0 on background
  std::vector<float> depth_m;  // (H, W) z in cam, +inf on background
};

/// z-buffer rasterisation of posed vertices (3, V) in world. Vertices are projected through the camera's exact lens, edges
/// are straight in the image, attributes are perspective-correct and sampled at pixel centres. A face covers the centres that
/// lie in the exact triangle of its projected vertices or on its edges, seen from either side: faces with a common edge leave
/// no gap. Of faces at the same depth the first one is seen. Faces without an area in the image and faces with a vertex that
/// cannot be projected are skipped.
PartUvMap RasterizeBody(const BodyTemplate& body, const Eigen::Matrix3Xf& vertices_in_world, const geometry::RigCamera& camera);

/// The point of the surface at each pixel, rows from the top.
struct FaceMap {
  int width = 0, height = 0;
  std::vector<int> face;                     // (H, W) -1: background
  std::vector<Eigen::Vector3f> barycentric;  // (H, W) of the face's corners in space, sum to one; 0 on background
};

/// The faces that RasterizeBody sees, by the same rules.
FaceMap RasterizeFaces(const BodyTemplate& body, const Eigen::Matrix3Xf& vertices_in_world, const geometry::RigCamera& camera);

}  // namespace mvstudio::body
