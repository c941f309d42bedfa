#include "avatar/body/mesh_raster.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/check.h"
#include "geometry/lens/camera.h"
#include "geometry/solve/signed_area.h"

namespace mvstudio::body {
namespace {

struct ScreenVertex {
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  double inv_z = 0;
  bool ok = false;
};

std::vector<ScreenVertex> ProjectAll(const Eigen::Matrix3Xf& vertices_in_world, const geometry::RigCamera& camera) {
  const geometry::Projector projector(camera.camera);
  const Eigen::Matrix3d rotation = camera.cam_from_world.rotation.toRotationMatrix();
  std::vector<ScreenVertex> screen(vertices_in_world.cols());
  for (size_t i = 0; i < screen.size(); ++i) {
    const Eigen::Vector3d x_in_cam = rotation * vertices_in_world.col(i).cast<double>() + camera.cam_from_world.translation;
    if (!(x_in_cam[2] > 1e-6)) continue;
    const geometry::Projection projection = projector.Project(x_in_cam);
    if (projection.status != Status::kOk) continue;
    screen[i] = {projection.px, 1 / x_in_cam[2], true};
  }
  return screen;
}

/// Where in an image a face is seen before what `depth_m` (H, W) knows, which is updated: `seen(at, shares of the corners)`.
template <class Seen>
void RasterizeFace(const ScreenVertex* v[3], int width, int height, std::vector<float>& depth_m, const Seen& seen) {
  const Eigen::Vector2d &a = v[0]->px, &b = v[1]->px, &c = v[2]->px;
  const double area = geometry::SignedArea2(a, b, c);
  if (area == 0) return;
  const double side = area > 0 ? 1 : -1;
  const auto [low_x, high_x] = std::minmax({a[0], b[0], c[0]});
  const auto [low_y, high_y] = std::minmax({a[1], b[1], c[1]});
  if (high_x < 0 || high_y < 0 || low_x > width - 1 || low_y > height - 1) return;
  const int x0 = static_cast<int>(std::ceil(std::max(low_x, 0.0))),
            x1 = static_cast<int>(std::floor(std::min(high_x, width - 1.0)));
  const int y0 = static_cast<int>(std::ceil(std::max(low_y, 0.0))),
            y1 = static_cast<int>(std::floor(std::min(high_y, height - 1.0)));
  for (int y = y0; y <= y1; ++y) {
    for (int x = x0; x <= x1; ++x) {
      const Eigen::Vector2d at_px(x, y);
      const double w0 = side * geometry::SignedArea2(b, c, at_px), w1 = side * geometry::SignedArea2(c, a, at_px),
                   w2 = side * geometry::SignedArea2(a, b, at_px);
      if (w0 < 0 || w1 < 0 || w2 < 0) continue;
      const double p0 = w0 * v[0]->inv_z, p1 = w1 * v[1]->inv_z, p2 = w2 * v[2]->inv_z, sum = p0 + p1 + p2;
      if (!(sum > 0)) continue;
      const float depth = static_cast<float>((w0 + w1 + w2) / sum);
      const size_t at = static_cast<size_t>(y) * width + x;
      if (depth >= depth_m[at]) continue;
      depth_m[at] = depth;
      seen(at, Eigen::Vector3f(static_cast<float>(p0 / sum), static_cast<float>(p1 / sum), static_cast<float>(p2 / sum)));
    }
  }
}

/// `on_face(f, corners)` for each face whose corners can be projected.
template <class OnFace>
void ForEachFace(const BodyTemplate& body, const Eigen::Matrix3Xf& vertices_in_world, const geometry::RigCamera& camera,
                 const OnFace& on_face) {
  MVS_CHECK(vertices_in_world.cols() == body.vertices.cols(), vertices_in_world.cols()
                                                                  << " posed vertices for a body of " << body.vertices.cols());
  const std::vector<ScreenVertex> screen = ProjectAll(vertices_in_world, camera);
  for (int f = 0; f < body.faces.cols(); ++f) {
    const ScreenVertex* v[3];
    bool ok = true;
    for (int k = 0; k < 3; ++k) {
      v[k] = &screen[body.faces(k, f)];
      ok = ok && v[k]->ok;
    }
    if (ok) on_face(f, v);
  }
}

}  // namespace

PartUvMap RasterizeBody(const BodyTemplate& body, const Eigen::Matrix3Xf& vertices_in_world,
                        const geometry::RigCamera& camera) {
  PartUvMap map;
  map.width = camera.camera.width_px;
  map.height = camera.camera.height_px;
  const size_t size = static_cast<size_t>(map.width) * map.height;
  map.part.assign(size, 0);
  map.u.assign(size, 0.f);
  map.v.assign(size, 0.f);
  map.depth_m.assign(size, std::numeric_limits<float>::infinity());
  ForEachFace(body, vertices_in_world, camera, [&](int f, const ScreenVertex* v[3]) {
    const Eigen::Vector2f uv[3] = {body.face_uv.col(3 * f), body.face_uv.col(3 * f + 1), body.face_uv.col(3 * f + 2)};
    RasterizeFace(v, map.width, map.height, map.depth_m, [&](size_t at, const Eigen::Vector3f& share) {
      map.part[at] = static_cast<uint8_t>(body.face_part[f]);
      const Eigen::Vector2f value = share[0] * uv[0] + share[1] * uv[1] + share[2] * uv[2];
      map.u[at] = std::clamp(value[0], 0.f, 1.f);
      map.v[at] = std::clamp(value[1], 0.f, 1.f);
    });
  });
  return map;
}

FaceMap RasterizeFaces(const BodyTemplate& body, const Eigen::Matrix3Xf& vertices_in_world, const geometry::RigCamera& camera) {
  FaceMap map;
  map.width = camera.camera.width_px;
  map.height = camera.camera.height_px;
  const size_t size = static_cast<size_t>(map.width) * map.height;
  map.face.assign(size, -1);
  map.barycentric.assign(size, Eigen::Vector3f::Zero());
  std::vector<float> depth_m(size, std::numeric_limits<float>::infinity());
  ForEachFace(body, vertices_in_world, camera, [&](int f, const ScreenVertex* v[3]) {
    RasterizeFace(v, map.width, map.height, depth_m, [&](size_t at, const Eigen::Vector3f& share) {
      map.face[at] = f;
      map.barycentric[at] = share;
    });
  });
  return map;
}

}  // namespace mvstudio::body
