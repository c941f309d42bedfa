#include "calib/lens/lens_limits.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "core/join.h"
#include "geometry/lens/camera.h"

namespace mvstudio::calib {
namespace {

/// Whether a lens has a ray, over a grid with the image's border.
constexpr int kCells = 16;
template <class Visit>
void VisitFolds(const geometry::Camera& camera, const Visit& visit) {
  const geometry::Projector projector(camera);
  for (int row = 0; row <= kCells; ++row) {
    for (int col = 0; col <= kCells; ++col) {
      const Eigen::Vector2d px(col * (camera.width_px - 1.0) / kCells, row * (camera.height_px - 1.0) / kCells);
      if (projector.Unproject(px).status != Status::kOk) visit(row, col, px);
    }
  }
}

/// 0 to 2: which third of the grid, its border strips a fifth.
int ThirdOf(int cell) { return cell * 5 < kCells ? 0 : (kCells - cell) * 5 < kCells ? 2 : 1; }

constexpr std::array<const char*, 9> kParts = {"the top-left corner",    "the top",    "the top-right corner",
                                               "the left side",          "the middle", "the right side",
                                               "the bottom-left corner", "the bottom", "the bottom-right corner"};

}  // namespace

PixelLimits PixelLimitsOf(const geometry::Camera& camera, double need_px) {
  constexpr double kShare = 0.002, kCornerShare = 0.01, kFailOfNeed = 1.5, kFailOfGivenNeed = 5;
  const double diagonal = std::hypot(camera.width_px, camera.height_px);
  const double corner = std::max(10.0, kCornerShare * diagonal);
  if (need_px > 0) return {need_px, kFailOfGivenNeed * need_px, std::max(corner, kFailOfGivenNeed * need_px)};
  const double side = std::max(1.0, kShare * diagonal), scale = std::max(1.0, diagonal / std::hypot(1920.0, 1080.0));
  return {side, std::max(5 * scale, kFailOfNeed * side), corner};
}

FoldedPlaces FindFolds(const geometry::Camera& camera) {
  FoldedPlaces places;
  std::array<bool, kParts.size()> parts{};
  const Eigen::Vector2d centre(camera.cx(), camera.cy());
  VisitFolds(camera, [&](int row, int col, const Eigen::Vector2d& px) {
    const double distance = (px - centre).norm();
    places.nearest_px = places.share > 0 ? std::min(places.nearest_px, distance) : distance;
    places.share += 1.0 / ((kCells + 1) * (kCells + 1));
    parts[static_cast<size_t>(3 * ThirdOf(row) + ThirdOf(col))] = true;
  });
  std::vector<std::string> names;
  for (size_t i = 0; i < parts.size(); ++i) {
    if (parts[i]) names.emplace_back(kParts[i]);
  }
  places.where = Join(names, ", ");
  return places;
}

}  // namespace mvstudio::calib
