#include "stages/overlay/draw_view.h"

#include <algorithm>
#include <cmath>

#include "dataset/footage/image_io.h"
#include "dataset/views/draw.h"
#include "stages/overlay/draw_solids.h"

namespace mvstudio::stages {
namespace {

using dataset::DrawColour;

// Those of the page (view_page.cc).
constexpr DrawColour kPerson{53, 167, 255}, kOtherPerson{255, 181, 46}, kFound{109, 255, 138}, kArrow{255, 77, 58}, kOutline{},
    kEdge{0, 0, 0};
constexpr double kBonePx = 2, kEdgePx = 4, kJointPx = 2.5, kRingPx = 4, kRingLinePx = 1.4;
constexpr int kUnknownWidth = 640, kUnknownHeight = 360;

/// From the footage's pixels to those of the reduced image; edges go to edges.
struct ToTile {
  double x, y;
  Eigen::Vector2d operator()(const Eigen::Vector2d& px) const { return {(px.x() + 0.5) * x - 0.5, (px.y() + 0.5) * y - 0.5}; }
};

void DrawPerson(const Scene& scene, const JointsPx& joints, const DrawColour& colour, const ToTile& to, Image* tile) {
  for (const auto& [width, ink] : {std::pair(kEdgePx, kEdge), std::pair(kBonePx, colour)}) {
    for (const auto& [a, b] : scene.skeleton.bones)
      dataset::DrawSegment(to(joints[static_cast<size_t>(a)]), to(joints[static_cast<size_t>(b)]), width, ink, tile);
  }
  for (const Eigen::Vector2d& px : joints) dataset::DrawDisc(to(px), kJointPx, colour, tile);
}

Image BlankFrame(const Scene& scene, const SceneCamera& camera) {
  if (camera.rig_idx < 0) return Image(kUnknownWidth, kUnknownHeight, 3);
  const geometry::Camera& lens = scene.rig.cameras[static_cast<size_t>(camera.rig_idx)].camera;
  return Image(lens.width_px, lens.height_px, 3);
}

}  // namespace

Image DrawnView(const Scene& scene, size_t camera_idx, const SceneView& view, const Image& frame, const Image& mask,
                int tile_px, const OverlayMarks& marks, const SolidsNow& solids) {
  Image whole = frame.empty() ? BlankFrame(scene, scene.cameras.at(camera_idx)) : frame;
  const bool has_mask = marks.masks && mask.width == whole.width && mask.height == whole.height && !mask.empty();
  Image tile = tile_px > 0 ? dataset::Reduced(whole, tile_px) : whole;
  const ToTile to{tile.width / static_cast<double>(whole.width), tile.height / static_cast<double>(whole.height)};
  if (has_mask) dataset::DrawMaskOutline(tile_px > 0 ? dataset::Reduced(mask, tile_px) : mask, kOutline, &tile);
  if (const int lens = scene.cameras.at(camera_idx).rig_idx; lens >= 0)
    DrawSolids(solids, scene.rig.cameras[static_cast<size_t>(lens)], {to.x, to.y}, &tile);
  if (marks.joints3d) {
    for (const auto& [person, joints] : view.projected)
      DrawPerson(scene, joints, person % 2 == 0 ? kPerson : kOtherPerson, to, &tile);
  }
  if (marks.joints2d) {
    for (const JointsPx& joints : view.detected) {
      for (const Eigen::Vector2d& px : joints) dataset::DrawRing(to(px), kRingPx, kRingLinePx, kFound, &tile);
    }
  }
  if (marks.residuals) {
    for (const auto& [from, at] : view.residuals) dataset::DrawSegment(to(from), to(at), kBonePx, kArrow, &tile);
  }
  return tile;
}

Image WithRender(const Image& tile, const Image& render) {
  Image both(2 * tile.width, tile.height, 3);
  dataset::PasteImage(tile, 0, 0, &both);
  if (render.empty()) return both;
  const double share =
      std::min({1.0, static_cast<double>(tile.width) / render.width, static_cast<double>(tile.height) / render.height});
  const int longer_px = std::max(1, static_cast<int>(share * std::max(render.width, render.height)));
  dataset::PasteImage(dataset::Reduced(render, longer_px), tile.width, 0, &both);
  return both;
}

Image GridOf(const std::vector<Image>& images) {
  const int count = static_cast<int>(images.size());
  const int columns = std::max(1, static_cast<int>(std::ceil(std::sqrt(count)))), rows = (count + columns - 1) / columns;
  int width = 2, height = 2;
  for (const Image& image : images) width = std::max(width, image.width), height = std::max(height, image.height);
  width += width % 2, height += height % 2;
  Image grid(columns * width, std::max(1, rows) * height, 3);
  for (int i = 0; i < count; ++i)
    dataset::PasteImage(images[static_cast<size_t>(i)], i % columns * width, i / columns * height, &grid);
  return grid;
}

}  // namespace mvstudio::stages
