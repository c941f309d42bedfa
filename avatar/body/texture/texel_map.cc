#include "avatar/body/texture/texel_map.h"

#include <algorithm>
#include <cmath>

namespace mvstudio::body {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

double Cross(const Vector2d& a, const Vector2d& b) { return a[0] * b[1] - a[1] * b[0]; }

void MapFace(const BodyTemplate& body, int f, TexelMap* map) {
  const int size = map->size_px;
  Vector2d corner[3];
  for (int k = 0; k < 3; ++k) corner[k] = body.face_uv.col(3 * f + k).cast<double>() * size - Vector2d(0.5, 0.5);
  const double area = Cross(corner[1] - corner[0], corner[2] - corner[0]);
  if (!(std::abs(area) > 1e-9)) return;
  const auto [x_low, x_high] = std::minmax({corner[0][0], corner[1][0], corner[2][0]});
  const auto [y_low, y_high] = std::minmax({corner[0][1], corner[1][1], corner[2][1]});
  const size_t chart = static_cast<size_t>(body.face_part[f] - 1) * size * size;
  for (int y = std::max(0, static_cast<int>(std::ceil(y_low))); y <= std::min<double>(size - 1, y_high); ++y) {
    for (int x = std::max(0, static_cast<int>(std::ceil(x_low))); x <= std::min<double>(size - 1, x_high); ++x) {
      const Vector2d at(x, y);
      const double a = Cross(corner[1] - at, corner[2] - at) / area, b = Cross(corner[2] - at, corner[0] - at) / area;
      if (a < -1e-9 || b < -1e-9 || a + b > 1 + 1e-9) continue;
      const size_t texel = chart + static_cast<size_t>(y) * size + x;
      map->face[texel] = f;
      map->barycentric[texel] = Vector3d(a, b, 1 - a - b).cast<float>();
    }
  }
}

}  // namespace

TexelMap MapTexels(const BodyTemplate& body, int size_px) {
  TexelMap map;
  map.size_px = size_px;
  const size_t count = static_cast<size_t>(kNumParts) * size_px * size_px;
  map.face.assign(count, -1);
  map.barycentric.assign(count, Eigen::Vector3f::Zero());
  for (int f = 0; f < body.faces.cols(); ++f) MapFace(body, f, &map);
  return map;
}

Eigen::Vector3f AtTexel(const BodyTemplate& body, const TexelMap& map, size_t texel, const Eigen::Matrix3Xf& values) {
  Eigen::Vector3f value = Eigen::Vector3f::Zero();
  for (int k = 0; k < 3; ++k) value += map.barycentric[texel][k] * values.col(body.faces(k, map.face[texel]));
  return value;
}

}  // namespace mvstudio::body
