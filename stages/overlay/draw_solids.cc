#include "stages/overlay/draw_solids.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "dataset/views/draw.h"
#include "stages/view/outline.h"

namespace mvstudio::stages {
namespace {

constexpr dataset::DrawColour kBodyColour{196, 128, 255}, kBoardColour{255, 210, 63}, kAxisX{255, 77, 58},
    kAxisY{109, 255, 138};
constexpr double kBodyTint = 0.35, kBoardLinePx = 2, kBoardCornerPx = 2;
constexpr int kPartsOfLine = 12;  // a straight line is none behind a lens

/// A point in world to the pixels of the tile; NaN where the lens does not see it.
class TileView {
 public:
  TileView(const geometry::RigCamera& camera, const Eigen::Vector2d& scale)
      : camera_(camera), lens_(camera.camera), scale_(scale) {}
  Eigen::Vector2d operator()(const Eigen::Vector3d& x_in_world) const {
    const auto seen = lens_.Project(camera_.cam_from_world * x_in_world);
    if (seen.status != Status::kOk) return Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
    return ((seen.px.array() + 0.5) * scale_.array() - 0.5).matrix();
  }

 private:
  const geometry::RigCamera& camera_;
  geometry::Projector lens_;
  Eigen::Vector2d scale_;
};

void DrawLine(const TileView& to, const Eigen::Vector3d& a, const Eigen::Vector3d& b, const dataset::DrawColour& colour,
              Image* tile) {
  for (int i = 0; i < kPartsOfLine; ++i) {
    const double from = static_cast<double>(i) / kPartsOfLine, end = static_cast<double>(i + 1) / kPartsOfLine;
    dataset::DrawSegment(to(a + from * (b - a)), to(a + end * (b - a)), kBoardLinePx, colour, tile);
  }
}

void DrawPlacedBoard(const PlacedBoard& board, const TileView& to, Image* tile) {
  const Eigen::Index n = board.outline.cols();
  for (Eigen::Index i = 0; i < n; ++i) DrawLine(to, board.outline.col(i), board.outline.col((i + 1) % n), kBoardColour, tile);
  for (Eigen::Index i = 0; i < board.corners.cols(); ++i)
    dataset::DrawDisc(to(board.corners.col(i)), kBoardCornerPx, kBoardColour, tile);
  DrawLine(to, board.axes.col(0), board.axes.col(1), kAxisX, tile);
  DrawLine(to, board.axes.col(0), board.axes.col(2), kAxisY, tile);
}

void DrawBody(const SolidsNow& solids, const TileView& to, Image* tile) {
  Eigen::Matrix2Xd px(2, solids.vertices.cols());
  for (Eigen::Index v = 0; v < px.cols(); ++v) px.col(v) = to(solids.vertices.col(v));
  const Image mask = TriangleMask(px, solids.faces, tile->width, tile->height);
  const int ink[] = {kBodyColour.r, kBodyColour.g, kBodyColour.b};
  for (size_t i = 0; i < mask.pixels.size(); ++i) {
    if (mask.pixels[i] == 0) continue;
    for (size_t k = 0; k < 3; ++k) {
      uint8_t& value = tile->pixels[3 * i + k];
      value = static_cast<uint8_t>(std::lround((1 - kBodyTint) * value + kBodyTint * ink[k]));
    }
  }
  dataset::DrawMaskOutline(mask, kBodyColour, tile);
}

}  // namespace

void DrawSolids(const SolidsNow& solids, const geometry::RigCamera& camera, const Eigen::Vector2d& scale, Image* tile) {
  const TileView to(camera, scale);
  if (solids.vertices.cols() > 0) DrawBody(solids, to, tile);
  for (const PlacedBoard& board : solids.boards) DrawPlacedBoard(board, to, tile);
}

}  // namespace mvstudio::stages
