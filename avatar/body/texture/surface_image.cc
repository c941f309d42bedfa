#include "avatar/body/texture/surface_image.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "avatar/body/surface_nets.h"
#include "core/check.h"

namespace mvstudio::body {
namespace {

constexpr int kChartPx = 64, kScalePx = 10;

/// Looks from far away along `forward` (horizontal) at the middle of the body, whose larger extent fills `size_px`.
geometry::RigCamera FarCamera(const BodyTemplate& body, const Eigen::Vector3d& forward, int size_px) {
  constexpr double kDistanceM = 30, kMargin = 1.05;
  const Eigen::Vector3d low = body.vertices.rowwise().minCoeff().cast<double>(),
                        high = body.vertices.rowwise().maxCoeff().cast<double>();
  const Eigen::Vector3d down(0, 0, -1), right = down.cross(forward);
  geometry::RigCamera far;
  far.camera.width_px = far.camera.height_px = size_px;
  const double focal = size_px * kDistanceM / (kMargin * (high - low).maxCoeff());
  far.camera.params = Eigen::Vector4d(focal, focal, 0.5 * (size_px - 1), 0.5 * (size_px - 1));
  Eigen::Matrix3d rotation;
  rotation << right.transpose(), down.transpose(), forward.transpose();
  far.cam_from_world.rotation = Eigen::Quaterniond(rotation);
  far.cam_from_world.translation = -(rotation * (0.5 * (low + high) - kDistanceM * forward));
  return far;
}

/// Puts the body, premultiplied on black, on white at column `left`.
void PutOnWhite(const RenderedBody& seen, int left, Image* page) {
  for (int y = 0; y < seen.image.height; ++y) {
    for (int x = 0; x < seen.image.width; ++x) {
      for (int c = 0; c < 3; ++c)
        page->Pixel(left + x, y)[c] =
            static_cast<uint8_t>(std::min(255, seen.image.Pixel(x, y)[c] + 255 - *seen.cover.Pixel(x, y)));
    }
  }
}

void DrawScale(const ColourRange& range, int top, Image* page) {
  for (int x = 0; x < page->width; ++x) {
    const double share = (x + 0.5) / page->width;
    const Eigen::Vector3f colour = DivergingColour((1 - share) * range.low + share * range.limit, range.limit);
    for (int y = top; y < page->height; ++y) {
      for (int c = 0; c < 3; ++c) page->Pixel(x, y)[c] = static_cast<uint8_t>(std::lround(255 * colour[c]));
    }
  }
}

}  // namespace

Textures PaintVertices(const BodyTemplate& body, const Eigen::Matrix3Xf& colours, int size_px) {
  MVS_CHECK(colours.cols() == body.vertices.cols(), colours.cols() << " colours for " << body.vertices.cols() << " vertices");
  const TexelMap map = MapTexels(body, size_px);
  const size_t chart = static_cast<size_t>(size_px) * size_px;
  Textures out;
  std::vector<uint8_t> known(kNumParts * chart, 0);
  for (size_t part = 0; part < kNumParts; ++part) {
    out[part] = Image(size_px, size_px, 3, 128);
    for (size_t t = 0; t < chart; ++t) {
      if (map.face[part * chart + t] < 0) continue;
      const Eigen::Vector3f colour = AtTexel(body, map, part * chart + t, colours);
      for (int c = 0; c < 3; ++c)
        out[part].pixels[3 * t + c] = static_cast<uint8_t>(std::lround(255 * std::clamp(colour[c], 0.0f, 1.0f)));
      known[part * chart + t] = 1;
    }
  }
  FillTexels(std::move(known), &out);
  return out;
}

Eigen::Vector3f DivergingColour(double value, double limit) {
  if (!std::isfinite(value)) return Eigen::Vector3f::Constant(0.35f);
  const Eigen::Vector3f blue(0.13f, 0.40f, 0.67f), grey(0.93f, 0.93f, 0.93f), red(0.70f, 0.09f, 0.17f);
  const auto share = static_cast<float>(std::clamp(value / limit, -1.0, 1.0));
  return grey + std::abs(share) * ((share < 0 ? blue : red) - grey);
}

Image SurfaceImage(const BodyTemplate& body, const Eigen::VectorXd& values, const ColourRange& range, int height_px) {
  MVS_CHECK(values.size() == body.vertices.cols() && range.limit > 0 && range.low < range.limit && height_px >= 32,
            "values of the vertices, and their limit");
  const int size = height_px - kScalePx;
  const Eigen::Matrix3Xf normals = VertexNormals(body.vertices, body.faces);
  Image page(2 * size, height_px, 3, 255);
  for (const int side : {0, 1}) {
    const Eigen::Vector3d forward(0, side == 0 ? 1 : -1, 0);
    Eigen::Matrix3Xf colours(3, values.size());
    for (Eigen::Index v = 0; v < values.size(); ++v) {
      const float facing = std::max(0.0f, -normals.col(v).dot(forward.cast<float>()));
      colours.col(v) = (0.55f + 0.45f * facing) * DivergingColour(values[v], range.limit);
    }
    PutOnWhite(RenderBody(body, PaintVertices(body, colours, kChartPx), body.vertices, FarCamera(body, forward, size)),
               side * size, &page);
  }
  DrawScale(range, size, &page);
  return page;
}

}  // namespace mvstudio::body
