#include "synth/textured_room.h"

#include <algorithm>
#include <cmath>

#include "synth/cell_hash.h"

namespace mvstudio::synth {
namespace {

/// A patch of one colour per cell, some cells empty, with edges that are soft over a tenth of the cell.
Eigen::Vector3f Patches(uint64_t seed, float cell, float x, float y, const Eigen::Vector3f& below) {
  const int ix = static_cast<int>(std::floor(x / cell)), iy = static_cast<int>(std::floor(y / cell));
  Eigen::Vector3f color = below;
  for (int dy = -1; dy <= 1; ++dy) {
    for (int dx = -1; dx <= 1; ++dx) {
      const int cx = ix + dx, cy = iy + dy;
      if (CellHash(seed, cx, cy) < 0.45f) continue;
      const float ox = (x / cell - cx - 0.2f - 0.6f * CellHash(seed + 1, cx, cy)),
                  oy = (y / cell - cy - 0.2f - 0.6f * CellHash(seed + 2, cx, cy));
      const float turn = 6.2831853f * CellHash(seed + 3, cx, cy), c = std::cos(turn), s = std::sin(turn);
      const float a = std::abs(c * ox + s * oy) / (0.15f + 0.35f * CellHash(seed + 4, cx, cy));
      const float b = std::abs(c * oy - s * ox) / (0.15f + 0.35f * CellHash(seed + 5, cx, cy));
      const float inside = std::clamp((1 - std::max(a, b)) * 5, 0.f, 1.f);
      const Eigen::Vector3f paint(40 + 180 * CellHash(seed + 6, cx, cy), 40 + 180 * CellHash(seed + 7, cx, cy),
                                  40 + 180 * CellHash(seed + 8, cx, cy));
      color += inside * 0.75f * (paint - color);
    }
  }
  return color;
}

Eigen::Vector3f SurfaceColor(uint64_t seed, float x, float y) {
  Eigen::Vector3f color(130, 128, 124);
  int level = 0;
  for (const float cell : {0.6f, 0.25f, 0.1f, 0.06f})
    color = Patches(seed + 100 * static_cast<uint64_t>(level++), cell, x, y, color);
  return color;
}

}  // namespace

Eigen::Vector3f TexturedRoom::Color(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction) const {
  const Eigen::Vector3f low(-size_m.x() / 2, -size_m.y() / 2, 0), high(size_m.x() / 2, size_m.y() / 2, size_m.z());
  float nearest = 1e9f;
  int face = 0;
  for (int axis = 0; axis < 3; ++axis) {
    if (direction[axis] == 0) continue;
    const float t = ((direction[axis] > 0 ? high[axis] : low[axis]) - origin[axis]) / direction[axis];
    if (t < nearest) nearest = t, face = 2 * axis + (direction[axis] > 0);
  }
  const Eigen::Vector3f at = origin + nearest * direction;
  const int axis = face / 2;
  const float along = axis == 0 ? at.y() : at.x(), up = axis == 2 ? at.y() : at.z();
  return SurfaceColor(seed * 1000003 + 7919 * static_cast<uint64_t>(face), along, up);
}

}  // namespace mvstudio::synth
