#include "avatar/body/files/atlas.h"

#include <algorithm>
#include <map>
#include <tuple>

#include "core/check.h"

namespace mvstudio::body {
namespace {

constexpr int kMaxChartPx = 1 << 14;

uint32_t BigEndianAt(const std::string& bytes, size_t at) {
  uint32_t value = 0;
  for (size_t i = 0; i < 4; ++i) value = value << 8 | static_cast<uint8_t>(bytes[at + i]);
  return value;
}

/// Cell of the chart with its border, from the chart's outermost pixels outwards.
void CopyChart(const Image& chart, int column, int row, Image* atlas) {
  const int size = chart.width, border = AtlasBorderPx(size), cell = size + 2 * border;
  for (int y = 0; y < cell; ++y) {
    for (int x = 0; x < cell; ++x) {
      const uint8_t* from = chart.Pixel(std::clamp(x - border, 0, size - 1), std::clamp(y - border, 0, size - 1));
      std::copy_n(from, 3, atlas->Pixel(column * cell + x, row * cell + y));
    }
  }
}

}  // namespace

int AtlasBorderPx(int chart_px) { return std::max(1, chart_px / 16); }

int AtlasSizePx(int chart_px) {
  MVS_CHECK(chart_px > 0 && chart_px <= kMaxChartPx, "chart_px = " << chart_px);
  return kAtlasSide * (chart_px + 2 * AtlasBorderPx(chart_px));
}

Image AtlasImage(const std::array<Image, kNumParts>& charts) {
  const int chart_px = charts[0].width, size = AtlasSizePx(chart_px);
  Image atlas(size, size, 3);
  for (int k = 0; k < kNumParts; ++k) {
    const Image& chart = charts[static_cast<size_t>(k)];
    MVS_CHECK(chart.width == chart_px && chart.height == chart_px && chart.channels == 3,
              "chart " << k << " is " << chart.width << " x " << chart.height << " x " << chart.channels);
    CopyChart(chart, k % kAtlasSide, k / kAtlasSide, &atlas);
  }
  return atlas;
}

std::optional<std::array<Image, kNumParts>> ChartsOfAtlas(const Image& atlas) {
  int chart_px = 2;
  while (chart_px < kMaxChartPx && AtlasSizePx(chart_px) < atlas.width) ++chart_px;
  if (AtlasSizePx(chart_px) != atlas.width || atlas.height != atlas.width || atlas.channels != 3) return std::nullopt;
  const int border = AtlasBorderPx(chart_px), cell = chart_px + 2 * border;
  std::array<Image, kNumParts> charts;
  for (int k = 0; k < kNumParts; ++k) {
    Image& chart = charts[static_cast<size_t>(k)] = Image(chart_px, chart_px, 3);
    for (int y = 0; y < chart_px; ++y) {
      const uint8_t* row = atlas.Pixel(k % kAtlasSide * cell + border, k / kAtlasSide * cell + border + y);
      std::copy_n(row, 3 * chart_px, chart.Pixel(0, y));
    }
  }
  return charts;
}

Eigen::Vector2f AtlasUv(int part, const Eigen::Vector2f& chart_uv, int chart_px) {
  MVS_CHECK(part >= 1 && part <= kNumParts, "part " << part);
  const int border = AtlasBorderPx(chart_px), cell = chart_px + 2 * border, chart = part - 1;
  const Eigen::Vector2d corner(chart % kAtlasSide * cell + border, chart / kAtlasSide * cell + border);
  const Eigen::Vector2d inside = chart_uv.cast<double>().cwiseMax(0).cwiseMin(1) * chart_px;
  return ((corner + inside) / (kAtlasSide * cell)).cast<float>();
}

void CheckAtlas(const AtlasPng& atlas) {
  const std::string& png = atlas.bytes;
  MVS_CHECK(png.size() > 24 && png.compare(0, 8, "\x89PNG\r\n\x1a\n") == 0, "the atlas is no PNG");
  const auto size = static_cast<uint32_t>(AtlasSizePx(atlas.chart_px));
  MVS_CHECK(BigEndianAt(png, 16) == size && BigEndianAt(png, 20) == size,
            "an atlas of " << BigEndianAt(png, 16) << " x " << BigEndianAt(png, 20) << " px; charts of " << atlas.chart_px
                           << " px make one of " << size);
}

AtlasMesh UnwrapOntoAtlas(const BodyTemplate& body, int chart_px) {
  AtlasMesh mesh;
  mesh.faces.resize(3, body.faces.cols());
  std::vector<Eigen::Vector2f> uv;
  std::map<std::tuple<int, int, float, float>, int> corner_of;  // vertex, part, u, v
  for (Eigen::Index f = 0; f < body.faces.cols(); ++f) {
    const int part = body.face_part[static_cast<size_t>(f)];
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector2f chart_uv = body.face_uv.col(3 * f + k);
      const int vertex = body.faces(k, f), next = static_cast<int>(uv.size());
      const auto [at, is_new] = corner_of.emplace(std::make_tuple(vertex, part, chart_uv.x(), chart_uv.y()), next);
      if (is_new) mesh.vertices.push_back(vertex), uv.push_back(AtlasUv(part, chart_uv, chart_px));
      mesh.faces(k, f) = at->second;
    }
  }
  mesh.uv.resize(2, static_cast<Eigen::Index>(uv.size()));
  for (size_t i = 0; i < uv.size(); ++i) mesh.uv.col(static_cast<Eigen::Index>(i)) = uv[i];
  return mesh;
}

}  // namespace mvstudio::body
