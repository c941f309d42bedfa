#pragma once

#include <Eigen/Core>
#include <vector>

#include "avatar/body/body_template.h"
#include "core/image.h"
#include "geometry/rig/rig.h"

namespace mvstudio::body {

/// A vertex on the outline of the posed body in an image.
struct RimPoint {
  int vertex = 0;
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  Eigen::Vector2d outward = Eigen::Vector2d::UnitX();         ///< unit, the surface's normal as the image shows it
  Eigen::RowVector3d d_out_d_x = Eigen::RowVector3d::Zero();  ///< px along `outward` for each metre of the vertex in world
};

/// Vertices (3, V) of a body in an image: 255 where it covers the pixel's centre.
Image RasterizeCover(const Eigen::Matrix3Xi& faces, const Eigen::Matrix3Xf& vertices_in_world,
                     const geometry::RigCamera& camera);

/// Vertices between faces that look at the camera and faces that look away, where the outline of the whole body runs; those
/// before or behind other parts of the body are left out, and those within 4 px of the image's edge.
std::vector<RimPoint> FindRim(const Eigen::Matrix3Xi& faces, const Eigen::Matrix3Xf& vertices_in_world,
                              const geometry::RigCamera& camera);

}  // namespace mvstudio::body
