#pragma once

#include <Eigen/Core>
#include <vector>

#include "body/body_template.h"
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
/// are straight in the image, attributes are perspective-correct and sampled at pixel centres. Faces with a vertex that
/// cannot be projected are skipped.
PartUvMap RasterizeBody(const BodyTemplate& body, const Eigen::Matrix3Xf& vertices_in_world, const geometry::RigCamera& camera);

}  // namespace mvstudio::body
