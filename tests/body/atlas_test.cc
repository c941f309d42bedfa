#include "avatar/body/files/atlas.h"

#include <algorithm>
#include <set>

#include "core/error.h"
#include "tests/body/posed.h"
#include "tests/support/test.h"

namespace mvstudio::body {
namespace {

std::array<Image, kNumParts> Charts(int size) {
  std::array<Image, kNumParts> charts;
  for (size_t k = 0; k < kNumParts; ++k) {
    charts[k] = Image(size, size, 3);
    for (size_t i = 0; i < charts[k].pixels.size(); ++i) charts[k].pixels[i] = static_cast<uint8_t>(7 * i + 31 * k);
  }
  return charts;
}

/// Bilinear, clamped to the edge, as a renderer samples; (0, 0) is the image's corner.
double Sample(const Image& image, const Eigen::Vector2d& uv, int channel) {
  const Eigen::Vector2d at = uv.cwiseProduct(Eigen::Vector2d(image.width, image.height)) - Eigen::Vector2d(0.5, 0.5);
  const auto x = static_cast<int>(std::floor(at.x())), y = static_cast<int>(std::floor(at.y()));
  double sum = 0;
  for (int k = 0; k < 4; ++k) {
    const int px = x + k % 2, py = y + k / 2;
    const double weight = (1 - std::abs(at.x() - px)) * (1 - std::abs(at.y() - py));
    sum += weight * image.Pixel(std::clamp(px, 0, image.width - 1), std::clamp(py, 0, image.height - 1))[channel];
  }
  return sum;
}

TEST(Atlas, SamplesAsItsCharts) {
  for (const int size : {1, 2, 33}) {
    const auto charts = Charts(size);
    const Image atlas = AtlasImage(charts);
    EXPECT_EQ(atlas.width, AtlasSizePx(size));
    for (int part = 1; part <= kNumParts; ++part) {
      for (const double u : {0.0, 0.013, 0.5, 0.77, 1.0}) {
        for (const double v : {0.0, 0.31, 1.0}) {
          const Eigen::Vector2d chart_uv(u, v), uv = AtlasUv(part, chart_uv.cast<float>(), size).cast<double>();
          const double expected = Sample(charts[static_cast<size_t>(part - 1)], chart_uv, 1);
          EXPECT_NEAR(Sample(atlas, uv, 1), expected, 0.02) << size << " " << part << " " << chart_uv.transpose();
        }
      }
    }
  }
}

TEST(Atlas, ChartsComeBackFromTheirAtlas) {
  for (const int size : {2, 3, 16, 33, 64}) {
    const auto charts = Charts(size), back = ChartsOfAtlas(AtlasImage(charts)).value();
    for (size_t k = 0; k < kNumParts; ++k) EXPECT_EQ(back[k].pixels, charts[k].pixels) << size;
  }
  Image painted = AtlasImage(Charts(16));
  painted.Pixel(0, 0)[0] ^= 255;  // a border
  EXPECT_EQ((*ChartsOfAtlas(painted))[0].pixels, Charts(16)[0].pixels);
}

TEST(Atlas, OtherImagesHaveNoCharts) {
  const int size = AtlasSizePx(16);
  for (const Image& image : {Image(0, 0, 3), Image(1, 1, 3), Image(15, 15, 3), Image(size + 1, size + 1, 3),
                             Image(size, size + 1, 3), Image(size, size, 4), Image(size, size, 1)})
    EXPECT_FALSE(ChartsOfAtlas(image)) << image.width << " x " << image.height;
}

TEST(Atlas, RefusesChartsOfDifferentSizes) {
  auto charts = Charts(4);
  charts[5] = Image(5, 4, 3);
  EXPECT_THROW(AtlasImage(charts), ContractViolation);
  charts[5] = Image(4, 4, 1);
  EXPECT_THROW(AtlasImage(charts), ContractViolation);
  EXPECT_THROW(AtlasImage({}), ContractViolation);
}

TEST(Atlas, PngHasToBeOfTheRightSize) {
  AtlasPng atlas = BlackAtlas(32);
  EXPECT_NO_THROW(CheckAtlas(atlas));
  atlas.chart_px = 33;
  EXPECT_THROW(CheckAtlas(atlas), ContractViolation);
  EXPECT_THROW(CheckAtlas({"no PNG at all, but long enough for one", 32}), ContractViolation);
}

TEST(Unwrap, SplitsVerticesWhereChartsMeet) {
  const BodyTemplate flag = Flag();
  const AtlasMesh mesh = UnwrapOntoAtlas(flag, 16);
  EXPECT_EQ(mesh.vertices, (std::vector<int>{0, 1, 2, 0, 2, 3}));
  EXPECT_EQ(mesh.faces.col(0), Eigen::Vector3i(0, 1, 2));
  EXPECT_EQ(mesh.faces.col(1), Eigen::Vector3i(3, 4, 5));
  EXPECT_EQ(mesh.uv.col(4), AtlasUv(2, {1, 1}, 16));
}

TEST(Unwrap, EveryCornerKeepsItsVertexAndPlace) {
  const BodyTemplate body = MakeMannequin(1.75, 0.5);
  const AtlasMesh mesh = UnwrapOntoAtlas(body, 64);
  std::set<std::tuple<int, float, float>> corners;
  for (Eigen::Index f = 0; f < body.faces.cols(); ++f) {
    for (int k = 0; k < 3; ++k) {
      const int corner = mesh.faces(k, f), vertex = mesh.vertices[static_cast<size_t>(corner)];
      const Eigen::Vector2f uv = AtlasUv(body.face_part[static_cast<size_t>(f)], body.face_uv.col(3 * f + k), 64);
      EXPECT_EQ(vertex, body.faces(k, f));
      EXPECT_EQ(mesh.uv.col(corner), uv);
      corners.emplace(vertex, uv.x(), uv.y());
    }
  }
  EXPECT_EQ(corners.size(), mesh.vertices.size());  // none twice
  EXPECT_LT(mesh.vertices.size(), 2 * static_cast<size_t>(body.vertices.cols()));
}

}  // namespace
}  // namespace mvstudio::body
