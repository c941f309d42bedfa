#include "synth/room.h"

#include <algorithm>
#include <cmath>

#include "synth/cell_hash.h"

namespace mvstudio::synth {
namespace {

constexpr float kWallRadius = 6;     // m
constexpr float kWallHeight = 4.5f;  // m

float Noise(uint64_t seed, float x, float y) {
  const int ix = static_cast<int>(std::floor(x)), iy = static_cast<int>(std::floor(y));
  auto smooth = [](float t) { return t * t * (3 - 2 * t); };
  const float fx = smooth(x - ix), fy = smooth(y - iy);
  const float top = CellHash(seed, ix, iy) * (1 - fx) + CellHash(seed, ix + 1, iy) * fx;
  const float bottom = CellHash(seed, ix, iy + 1) * (1 - fx) + CellHash(seed, ix + 1, iy + 1) * fx;
  return top * (1 - fy) + bottom * fy;
}

Eigen::Vector3f FloorColor(uint64_t seed, float x, float y) {
  const float tile_x = x / 0.5f, tile_y = y / 0.5f;
  const int ix = static_cast<int>(std::floor(tile_x)), iy = static_cast<int>(std::floor(tile_y));
  const bool joint = tile_x - ix < 0.03f || tile_y - iy < 0.03f;
  const float light = 1 + 0.10f * (CellHash(seed, ix, iy) - 0.5f) + 0.12f * (Noise(seed + 1, x * 3, y * 3) - 0.5f) +
                      0.08f * (Noise(seed + 2, x * 17, y * 17) - 0.5f);
  return Eigen::Vector3f(104, 98, 90) * light * (joint ? 0.8f : 1.f) * (1 - 0.03f * std::hypot(x, y));
}

Eigen::Vector3f WallColor(uint64_t seed, float angle, float z) {
  const float along = angle * kWallRadius;
  const float light = 0.94f + 0.03f * z + 0.10f * (Noise(seed + 3, along * 1.5f, z * 1.5f) - 0.5f) +
                      0.05f * (Noise(seed + 4, along * 9, z * 9) - 0.5f);
  const int panel = static_cast<int>(std::floor(along / 1.2f));
  const Eigen::Vector3f tint(CellHash(seed + 5, panel, 0) - 0.5f, CellHash(seed + 5, panel, 1) - 0.5f,
                             CellHash(seed + 5, panel, 2) - 0.5f);
  const bool frame = along / 1.2f - panel < 0.02f || z < 0.1f;
  return (Eigen::Vector3f(128, 132, 138) + 36 * tint) * light * (frame ? 0.75f : 1.f);
}

}  // namespace

Eigen::Vector3f Room::Color(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction) const {
  const float a = direction.head<2>().squaredNorm(), b = origin.head<2>().dot(direction.head<2>());
  const float c = origin.head<2>().squaredNorm() - kWallRadius * kWallRadius;
  const float wall = a > 0 ? (-b + std::sqrt(std::max(0.f, b * b - a * c))) / a : 1e9f;
  const float floor = direction[2] < 0 ? -origin[2] / direction[2] : 1e9f;
  const float roof = direction[2] > 0 ? (kWallHeight - origin[2]) / direction[2] : 1e9f;
  const Eigen::Vector3f at = origin + std::min({wall, floor, roof}) * direction;
  if (roof < wall) return {70, 70, 74};
  if (floor < wall) return textured ? FloorColor(seed, at[0], at[1]) : Eigen::Vector3f(100, 98, 94);
  return textured ? WallColor(seed, std::atan2(at[1], at[0]), at[2]) : Eigen::Vector3f(128, 130, 134);
}

}  // namespace mvstudio::synth
