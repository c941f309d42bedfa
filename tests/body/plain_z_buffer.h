#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "avatar/body/body_template.h"
#include "geometry/lens/camera.h"
#include "geometry/rig/rig.h"

namespace mvstudio::body {

/// A pixel of a z-buffer without tricks: rays against triangles in space, in double, for pinhole cameras.
struct PlainPixel {
  int face = -1;  ///< the nearest one
  double depth_m = std::numeric_limits<double>::infinity(), second_m = depth_m;
  Eigen::Vector3d shares = Eigen::Vector3d::Zero();  ///< of the face's corners in the point that is seen
  bool near_edge = false;                            ///< rounding decides whether some face covers the centre

  /// Neither an edge nor two faces at one depth: every right z-buffer gives the same.
  bool IsSure() const { return !near_edge && !(second_m - depth_m < 1e-6 * depth_m); }
};

/// The ray through the centre of (x, y) against the triangle (v0, v1, v2) in cam: it hits where the three volumes that ray and
/// edges span have one sign.
inline void HitByRay(const Eigen::Vector3d& ray, const Eigen::Matrix3d& v, int face, PlainPixel* pixel) {
  Eigen::Vector3d volumes;
  for (int k = 0; k < 3; ++k) volumes[k] = ray.dot(v.col((k + 1) % 3).cross(v.col((k + 2) % 3)));
  const Eigen::Vector3d shares = volumes / volumes.sum();
  const double margin = shares.minCoeff();
  if (margin < -1e-9) return;
  if (!(margin > 1e-9)) pixel->near_edge = true;
  const Eigen::Vector3d normal = (v.col(1) - v.col(0)).cross(v.col(2) - v.col(0));
  const double depth = v.col(0).dot(normal) / ray.dot(normal);
  if (!(depth < pixel->depth_m)) {
    pixel->second_m = std::min(pixel->second_m, depth);
    return;
  }
  pixel->second_m = pixel->depth_m;
  pixel->depth_m = depth, pixel->face = face, pixel->shares = shares;
}

/// (H, W). Faces with a vertex that is not in front of the camera are left out.
inline std::vector<PlainPixel> PlainZBuffer(const BodyTemplate& body, const Eigen::Matrix3Xf& vertices_in_world,
                                            const geometry::RigCamera& camera) {
  const geometry::Camera& lens = camera.camera;
  const Eigen::Matrix3d rotation = camera.cam_from_world.rotation.toRotationMatrix();
  std::vector<PlainPixel> pixels(static_cast<size_t>(lens.width_px) * static_cast<size_t>(lens.height_px));
  for (Eigen::Index f = 0; f < body.faces.cols(); ++f) {
    Eigen::Matrix3d v;
    for (int k = 0; k < 3; ++k)
      v.col(k) = rotation * vertices_in_world.col(body.faces(k, f)).cast<double>() + camera.cam_from_world.translation;
    if (!v.allFinite() || !(v.row(2).minCoeff() > 1e-6)) continue;
    const Eigen::Array3d px = lens.fx() * v.row(0).array() / v.row(2).array() + lens.cx(),
                         py = lens.fy() * v.row(1).array() / v.row(2).array() + lens.cy();
    const auto clamped = [](double value, int size) { return static_cast<int>(std::clamp(value, -1.0, size + 0.0)); };
    for (int y = std::max(0, clamped(py.minCoeff() - 1, lens.height_px));
         y <= std::min(lens.height_px - 1, clamped(py.maxCoeff() + 1, lens.height_px)); ++y) {
      for (int x = std::max(0, clamped(px.minCoeff() - 1, lens.width_px));
           x <= std::min(lens.width_px - 1, clamped(px.maxCoeff() + 1, lens.width_px)); ++x) {
        const Eigen::Vector3d ray((x - lens.cx()) / lens.fx(), (y - lens.cy()) / lens.fy(), 1);
        HitByRay(ray, v, static_cast<int>(f),
                 &pixels[static_cast<size_t>(y) * static_cast<size_t>(lens.width_px) + static_cast<size_t>(x)]);
      }
    }
  }
  return pixels;
}

}  // namespace mvstudio::body
