#include "body/texture/texel_map.h"

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

void FillTexels(std::vector<uint8_t>* known, Image* texture) {
  const int size = texture->width;
  for (bool changed = true; changed;) {
    changed = false;
    const std::vector<uint8_t> before = *known;
    for (int y = 0; y < size; ++y) {
      for (int x = 0; x < size; ++x) {
        if (before[static_cast<size_t>(y) * size + x]) continue;
        int sum[3] = {0, 0, 0}, count = 0;
        for (int dy = -1; dy <= 1; ++dy) {
          for (int dx = -1; dx <= 1; ++dx) {
            const int nx = x + dx, ny = y + dy;
            if (nx < 0 || ny < 0 || nx >= size || ny >= size || !before[static_cast<size_t>(ny) * size + nx]) continue;
            for (int c = 0; c < 3; ++c) sum[c] += texture->Pixel(nx, ny)[c];
            ++count;
          }
        }
        if (count == 0) continue;
        for (int c = 0; c < 3; ++c) texture->Pixel(x, y)[c] = static_cast<uint8_t>((sum[c] + count / 2) / count);
        (*known)[static_cast<size_t>(y) * size + x] = 1, changed = true;
      }
    }
  }
}

}  // namespace mvstudio::body
