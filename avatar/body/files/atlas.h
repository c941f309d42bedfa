#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <string>
#include <vector>

#include "avatar/body/body_template.h"

namespace mvstudio::body {

/// The charts of a body in one image: chart k (part k + 1) in column k % 5 and row k / 5. Each has a border that repeats its
/// outermost pixels, so that neither interpolation nor the first levels of a mipmap mix it with its neighbours.
inline constexpr int kAtlasSide = 5;  // charts

/// Sides of the border and of the whole atlas, px, of charts of `chart_px` x `chart_px`.
int AtlasBorderPx(int chart_px);
int AtlasSizePx(int chart_px);

/// (A, A, 3) of charts that are square RGB images of one size; the cell that is left over is black.
Image AtlasImage(const std::array<Image, kNumParts>& charts);

/// The charts of an atlas, of AtlasImage or edited since: borders are not looked at. Nothing for a size that no atlas has, and
/// for charts of less than 2 px.
std::optional<std::array<Image, kNumParts>> ChartsOfAtlas(const Image& atlas);

/// Chart coordinates in [0, 1] -> coordinates in the atlas, also in [0, 1], v down from the top: the centre of pixel (x, y) has
/// u = (x + 0.5) / A, v = (y + 0.5) / A.
Eigen::Vector2f AtlasUv(int part, const Eigen::Vector2f& chart_uv, int chart_px);

/// An atlas as an encoded file.
struct AtlasPng {
  std::string bytes;  // PNG of AtlasImage
  int chart_px = 0;   // side of its charts
};

/// Throws ContractViolation unless the PNG's header promises an atlas of such charts.
void CheckAtlas(const AtlasPng& atlas);

/// The mesh with one corner per vertex and place in the atlas: vertices are split where charts meet.
struct AtlasMesh {
  std::vector<int> vertices;  // (N) of the template, in the order of their first use
  Eigen::Matrix2Xf uv;        // (2, N) in the atlas
  Eigen::Matrix3Xi faces;     // (3, F) of the N corners
};
AtlasMesh UnwrapOntoAtlas(const BodyTemplate& body, int chart_px);

}  // namespace mvstudio::body
