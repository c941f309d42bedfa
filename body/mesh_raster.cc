#include "body/mesh_raster.h"

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

void RasterizeFace(const ScreenVertex* v[3], const Eigen::Vector2f uv[3], uint8_t part, PartUvMap* map) {
  const Eigen::Vector2d &a = v[0]->px, &b = v[1]->px, &c = v[2]->px;
  const double area = geometry::SignedArea2(a, b, c);
  if (area == 0) return;
  const double side = area > 0 ? 1 : -1;
  const auto [low_x, high_x] = std::minmax({a[0], b[0], c[0]});
  const auto [low_y, high_y] = std::minmax({a[1], b[1], c[1]});
  if (high_x < 0 || high_y < 0 || low_x > map->width - 1 || low_y > map->height - 1) return;
  const int x0 = static_cast<int>(std::ceil(std::max(low_x, 0.0))),
            x1 = static_cast<int>(std::floor(std::min(high_x, map->width - 1.0)));
  const int y0 = static_cast<int>(std::ceil(std::max(low_y, 0.0))),
            y1 = static_cast<int>(std::floor(std::min(high_y, map->height - 1.0)));
  for (int y = y0; y <= y1; ++y) {
    for (int x = x0; x <= x1; ++x) {
      const Eigen::Vector2d at_px(x, y);
      const double w0 = side * geometry::SignedArea2(b, c, at_px), w1 = side * geometry::SignedArea2(c, a, at_px),
                   w2 = side * geometry::SignedArea2(a, b, at_px);
      if (w0 < 0 || w1 < 0 || w2 < 0) continue;
      const double p0 = w0 * v[0]->inv_z, p1 = w1 * v[1]->inv_z, p2 = w2 * v[2]->inv_z, sum = p0 + p1 + p2;
      if (!(sum > 0)) continue;
      const float depth = static_cast<float>((w0 + w1 + w2) / sum);
      const size_t at = static_cast<size_t>(y) * map->width + x;
      if (depth >= map->depth_m[at]) continue;
      map->depth_m[at] = depth;
      map->part[at] = part;
      const Eigen::Vector2f value =
          static_cast<float>(p0 / sum) * uv[0] + static_cast<float>(p1 / sum) * uv[1] + static_cast<float>(p2 / sum) * uv[2];
      map->u[at] = std::clamp(value[0], 0.f, 1.f);
      map->v[at] = std::clamp(value[1], 0.f, 1.f);
    }
  }
}

}  // namespace

PartUvMap RasterizeBody(const BodyTemplate& body, const Eigen::Matrix3Xf& vertices_in_world,
                        const geometry::RigCamera& camera) {
  MVS_CHECK(vertices_in_world.cols() == body.vertices.cols(), vertices_in_world.cols()
                                                                  << " posed vertices for a body of " << body.vertices.cols());
  PartUvMap map;
  map.width = camera.camera.width_px;
  map.height = camera.camera.height_px;
  const size_t size = static_cast<size_t>(map.width) * map.height;
  map.part.assign(size, 0);
  map.u.assign(size, 0.f);
  map.v.assign(size, 0.f);
  map.depth_m.assign(size, std::numeric_limits<float>::infinity());
  const std::vector<ScreenVertex> screen = ProjectAll(vertices_in_world, camera);
  for (int f = 0; f < body.faces.cols(); ++f) {
    const ScreenVertex* v[3];
    Eigen::Vector2f uv[3];
    bool ok = true;
    for (int k = 0; k < 3; ++k) {
      v[k] = &screen[body.faces(k, f)];
      uv[k] = body.face_uv.col(3 * f + k);
      ok = ok && v[k]->ok;
    }
    if (ok) RasterizeFace(v, uv, static_cast<uint8_t>(body.face_part[f]), &map);
  }
  return map;
}

}  // namespace mvstudio::body
