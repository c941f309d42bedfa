#include "avatar/splats/raster.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "avatar/splats/lanes.h"
#include "avatar/splats/render.h"
#include "core/error.h"
#include "tests/splats/scenes.h"
#include "tests/support/test.h"

namespace mvstudio::splats {
namespace {

constexpr double kPi = 3.14159265358979323846;
const double kNan = std::numeric_limits<double>::quiet_NaN();

double Sigmoid(double x) { return 1 / (1 + std::exp(-x)); }

void SetColour(Scene* scene, size_t i, double r, double g, double b) {
  const double rgb[3] = {r, g, b};
  for (size_t c = 0; c < 3; ++c) scene->cloud.values.colour[3 * i + c] = (rgb[c] - 0.5) / 0.28209479177387814;
}

TEST(Raster, OneGaussianIsItsFormula) {
  Scene scene = FacingScene(41, {{20.3, 18.6, 2}}, 0.06);  // 3 px
  SetColour(&scene, 0, 0.9, 0.5, 0.1);
  const auto drawn = Draw(scene);
  const double variance = 9 + 0.1, opacity = 0.5 * 9 / variance;
  for (int y = 0; y < 41; ++y)
    for (int x = 0; x < 41; ++x) {
      const double square = (x - 20.3) * (x - 20.3) + (y - 18.6) * (y - 18.6);
      double alpha = opacity * std::exp(-square / (2 * variance));
      if (alpha < kLeastAlpha) alpha = 0;
      const size_t at = static_cast<size_t>(y) * 41 + x;
      EXPECT_NEAR(drawn.image.Plane(3)[at], alpha, 1e-3 * alpha);  // the linearised lens: 1e-3 off the axis
      EXPECT_NEAR(drawn.image.Plane(0)[at], 0.9 * drawn.image.Plane(3)[at], 1e-12);
      EXPECT_NEAR(drawn.image.Plane(2)[at], 0.1 * drawn.image.Plane(3)[at], 1e-12);
    }
}

/// The sum over pixels is the integral over the plane, without what lies below the least alpha: 2 pi sqrt(det) (o - least).
TEST(Raster, TheMipFilterKeepsTheLightOfAGaussian) {
  for (const double sigma_px : {0.2, 0.4, 0.8, 2.0, 5.0}) {
    Scene scene = FacingScene(64, {{31.3, 32.2, 2}}, sigma_px * 0.02);
    scene.cloud.values.opacity[0] = 8;
    const auto drawn = Draw(scene);
    double sum = 0;
    for (size_t i = 0; i < drawn.image.area(); ++i) sum += drawn.image.Plane(3)[i];
    const double before = sigma_px * sigma_px, after = before + 0.1, opacity = Sigmoid(8) * before / after;
    const double light = 2 * kPi * after * (opacity - kLeastAlpha);
    // A Gaussian of 0.37 px is sampled by few pixels; those above 0.99 are clamped.
    EXPECT_NEAR(sum, light, (sigma_px < 0.5 ? 0.3 : 0.02) * light) << sigma_px;
  }
}

TEST(Raster, TheNearerGaussianCoversTheFarther) {
  Scene scene = FacingScene(33, {{16, 16, 2}, {16, 16, 3}}, 0.2);
  SetColour(&scene, 0, 1, 0, 0), SetColour(&scene, 1, 0, 1, 0);
  scene.cloud.values.opacity = {0.4, 1.2};
  const auto near_first = Draw(scene);
  const size_t middle = 16 * 33 + 16;
  const double kept0 = 100 / 100.1, kept1 = (400.0 / 9) / (400.0 / 9 + 0.1);
  const double a0 = Sigmoid(0.4) * kept0, a1 = Sigmoid(1.2) * kept1;
  EXPECT_NEAR(near_first.image.Plane(0)[middle], a0, 1e-6);
  EXPECT_NEAR(near_first.image.Plane(1)[middle], (1 - a0) * a1, 1e-6);
  EXPECT_NEAR(near_first.image.Plane(3)[middle], 1 - (1 - a0) * (1 - a1), 1e-6);
  for (int k = 0; k < 3; ++k) scene.vertices.col(k)[2] = 3.5;  // on the axis: the same pixel
  const auto swapped = Draw(scene);
  EXPECT_NEAR(swapped.image.Plane(1)[middle], a1, 1e-6);
  EXPECT_LT(swapped.image.Plane(0)[middle], 1 - a1);
}

TEST(Raster, EqualDepthsKeepTheOrderOfTheCloud) {
  Scene scene = FacingScene(33, {{16, 16, 2}, {16, 16, 2}}, 0.2);
  SetColour(&scene, 0, 1, 0, 0), SetColour(&scene, 1, 0, 1, 0);
  const size_t middle = 16 * 33 + 16;
  const auto drawn = Draw(scene);
  EXPECT_GT(drawn.image.Plane(0)[middle], drawn.image.Plane(1)[middle] * 1.5);
  std::swap(scene.cloud.face[0], scene.cloud.face[1]);
  EXPECT_EQ(Draw(scene).image.values, drawn.image.values);
}

TEST(Raster, OpacityEndsBelowOne) {
  Scene scene = FacingScene(33, {{16, 16, 2}}, 0.2);
  for (const double logit : {50.0, 700.0, 1e300}) {
    scene.cloud.values.opacity[0] = logit;
    const auto drawn = Draw(scene);
    EXPECT_DOUBLE_EQ(*std::max_element(drawn.image.Plane(3), drawn.image.Plane(3) + 33 * 33), kMostAlpha) << logit;
  }
  scene.cloud.values.opacity[0] = -1e300;
  EXPECT_TRUE(Draw(scene).projected.splats.empty());
  EXPECT_EQ(Draw(scene).projected.skipped.not_finite, 0);
}

TEST(Raster, TinyGaussiansVanishAndHugeOnesCoverEverything) {
  Scene scene = FacingScene(33, {{16, 16, 2}}, 0.2);
  for (double& value : scene.cloud.values.log_scale) value = -1e4;
  EXPECT_TRUE(Draw(scene).projected.splats.empty());
  for (double& value : scene.cloud.values.log_scale) value = 1e4;
  scene.cloud.values.opacity[0] = 2;
  const auto drawn = Draw(scene);
  ASSERT_EQ(drawn.projected.splats.size(), 1u);
  for (size_t i = 0; i < drawn.image.area(); ++i) EXPECT_NEAR(drawn.image.Plane(3)[i], Sigmoid(2), 1e-3);
  const auto in_float = Draw<float>(CloudCast<float>(scene.cloud), {scene.faces, scene.vertices.cast<float>().eval()},
                                    ViewOf<float>(scene.camera), {});
  for (size_t i = 0; i < drawn.image.area(); ++i) EXPECT_NEAR(in_float.image.Plane(3)[i], Sigmoid(2), 1e-3);
}

TEST(Raster, WhatCannotBeShownIsCounted) {
  const Scene good = FacingScene(33, {{16, 16, 2}, {10, 10, 2}}, 0.1);
  Scene scene = good;
  scene.vertices.col(4) = scene.vertices.col(3);
  EXPECT_EQ(Draw(scene).projected.skipped.degenerate, 1);
  scene = good;
  scene.vertices.col(4) = 2 * scene.vertices.col(5) - scene.vertices.col(3);  // on a line
  EXPECT_EQ(Draw(scene).projected.skipped.degenerate, 1);
  for (const double z : {-2.0, 0.0, 0.049}) {
    scene = good;
    for (int k = 3; k < 6; ++k) scene.vertices.col(k)[2] = z;
    EXPECT_EQ(Draw(scene).projected.skipped.behind_camera, 1) << z;
    EXPECT_EQ(Draw(scene).projected.splats.size(), 1u);
  }
  scene = good;
  scene.vertices(1, 3) = kNan;
  EXPECT_EQ(Draw(scene).projected.skipped.not_finite, 1);
  ForEachGroup(scene.cloud.values, [&](Group group, int width, std::vector<double>& array) {
    for (const double bad : {kNan, std::numeric_limits<double>::infinity()}) {
      if (bad > 0 && (group == Group::kScale || group == Group::kOpacity)) continue;  // infinite ones mean the limit
      scene.vertices = good.vertices;
      const double before = array[static_cast<size_t>(width)];
      array[static_cast<size_t>(width)] = bad;
      const auto drawn = Draw(scene);
      array[static_cast<size_t>(width)] = before;
      EXPECT_EQ(drawn.projected.skipped.not_finite, 1) << static_cast<int>(group) << " " << bad;
      for (const double value : drawn.image.values) ASSERT_TRUE(std::isfinite(value));
    }
  });
  scene = good;
  for (size_t k = 4; k < 8; ++k) scene.cloud.values.rotation[k] = 0;
  EXPECT_EQ(Draw(scene).projected.skipped.not_finite, 1);
}

TEST(Raster, JustBeyondTheNearPlaneIsFinite) {
  Scene scene = FacingScene(33, {{16, 16, 0.0501}}, 0.2);
  scene.cloud.values.opacity[0] = 3;
  const auto drawn = Draw<float>(CloudCast<float>(scene.cloud), {scene.faces, scene.vertices.cast<float>().eval()},
                                 ViewOf<float>(scene.camera), {});
  ASSERT_EQ(drawn.projected.splats.size(), 1u);
  for (const float value : drawn.image.values) ASSERT_TRUE(std::isfinite(value));
  // 400 px wide, seen 16 px off in both directions.
  EXPECT_NEAR(drawn.image.Plane(3)[0], Sigmoid(3) * std::exp(-2 * 16 * 16 / (2 * 400.0 * 400.0)), 1e-4);
}

TEST(Raster, ASheetOfManyGaussiansIsOpaque) {
  std::vector<Eigen::Vector3d> places;
  for (int y = -4; y < 44; ++y)
    for (int x = -4; x < 44; ++x) places.emplace_back(x, y, 2);
  Scene scene = FacingScene(40, places, 0.7 * 0.02);  // a Gaussian of 0.7 px on each pixel
  for (size_t i = 0; i < places.size(); ++i) scene.cloud.values.opacity[i] = 3, SetColour(&scene, i, 0.2, 0.6, 0.8);
  const auto drawn = Draw(scene);
  for (size_t i = 0; i < drawn.image.area(); ++i) {
    EXPECT_GT(drawn.image.Plane(3)[i], 0.97);
    EXPECT_NEAR(drawn.image.Plane(1)[i], 0.6 * drawn.image.Plane(3)[i], 1e-9);
  }
}

/// The definition: every pixel looks at every Gaussian.
RasterImage<double> BruteForce(std::vector<Splat<double>> splats, int width, int height) {
  std::stable_sort(splats.begin(), splats.end(), [](const auto& a, const auto& b) { return a.depth < b.depth; });
  RasterImage<double> out{width, height, std::vector<double>(4 * static_cast<size_t>(width) * height)};
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      double through = 1;
      const size_t at = static_cast<size_t>(y) * width + x;
      for (const Splat<double>& s : splats) {
        const double dx = x - s.x, dy = y - s.y;
        double alpha = s.opacity * std::exp(-0.5 * (s.a * dx * dx + s.c * dy * dy) - s.b * dx * dy);
        if (alpha < kLeastAlpha || through <= kFullPixel) continue;
        alpha = std::min(alpha, kMostAlpha);
        for (int c = 0; c < 3; ++c) out.Plane(c)[at] += through * alpha * s.rgb[c];
        through *= 1 - alpha;
      }
      out.Plane(3)[at] = 1 - through;
    }
  return out;
}

TEST(Raster, TilesGiveWhatEveryPixelBySelfGives) {
  for (const uint64_t seed : {1, 2, 3}) {
    Scene scene = RandomScene(300, 1, seed, 61, 43);  // no multiples of a tile; many pixels become full
    for (double& value : scene.cloud.values.opacity) value += 2;
    const auto drawn = Draw(scene);
    const RasterImage<double> expected = BruteForce(drawn.projected.splats, 61, 43);
    for (size_t i = 0; i < expected.values.size(); ++i) EXPECT_NEAR(drawn.image.values[i], expected.values[i], 1e-12);
    EXPECT_GT(*std::max_element(expected.Plane(3), expected.Plane(3) + expected.area()), 1 - kFullPixel);
    const auto in_float = Draw<float>(CloudCast<float>(scene.cloud), {scene.faces, scene.vertices.cast<float>().eval()},
                                      ViewOf<float>(scene.camera), {});
    int far_off = 0;  // a rounding decides whether 1/255 counts
    for (size_t i = 0; i < expected.values.size(); ++i)
      far_off += std::abs(in_float.image.values[i] - expected.values[i]) > 1e-4;
    EXPECT_LT(far_off, 40);
  }
}

TEST(Raster, DoesNotDependOnTheNumberOfThreads) {
  const Scene scene = RandomScene(4000, 2, 5, 90, 70);
  const Cloud cloud = CloudCast<float>(scene.cloud);
  const Eigen::Matrix3Xf vertices = scene.vertices.cast<float>();
  const Rendered one = RenderSplats(cloud, scene.faces, vertices, scene.camera, {true, 1});
  const auto drawn = Draw<float>(cloud, {scene.faces, vertices}, ViewOf<float>(scene.camera), {true, 1});
  const auto gradient_of = [&](int threads) {
    return RasteriseBackward(drawn.projected.splats, drawn.tiles, drawn.image, drawn.image, threads);
  };
  const auto by_one = gradient_of(1);
  for (const int threads : {2, 3, 7}) {
    EXPECT_EQ(RenderSplats(cloud, scene.faces, vertices, scene.camera, {true, threads}).image.values, one.image.values);
    const auto by_many = gradient_of(threads);
    for (size_t i = 0; i < by_one.size(); ++i) {
      EXPECT_EQ(by_one[i].x, by_many[i].x);
      EXPECT_EQ(by_one[i].b, by_many[i].b);
      EXPECT_EQ(by_one[i].opacity, by_many[i].opacity);
    }
  }
}

TEST(Raster, ExpIsExp) {
  for (double x = -80; x <= 0; x += 0.0137) {
    Row<float> in, out;
    for (int l = 0; l < kTilePx; ++l) in[l] = static_cast<float>(std::min(0.0, x + 1e-3 * l));
    ExpRow(in, &out);
    for (int l = 0; l < kTilePx; ++l) EXPECT_NEAR(out[l] / std::exp(static_cast<double>(in[l])), 1, 3e-7) << in[l];
  }
}

TEST(Render, RefusesLensesAndOtherMeshes) {
  const Scene scene = FacingScene(20, {{10, 10, 2}}, 0.1);
  const Cloud cloud = CloudCast<float>(scene.cloud);
  const Eigen::Matrix3Xf vertices = scene.vertices.cast<float>(), fewer = vertices.leftCols(2);
  geometry::RigCamera lens = scene.camera;
  lens.camera.model = geometry::LensModel::kBrown1;
  EXPECT_THROW(RenderSplats(cloud, scene.faces, vertices, lens, {}), ContractViolation);
  EXPECT_THROW(RenderSplats(cloud, scene.faces, fewer, scene.camera, {}), ContractViolation);
  Cloud other = cloud;
  other.face[0] = 1;
  EXPECT_THROW(RenderSplats(other, scene.faces, vertices, scene.camera, {}), ContractViolation);
  other = cloud;
  other.values.opacity.push_back(0);
  EXPECT_THROW(RenderSplats(other, scene.faces, vertices, scene.camera, {}), ContractViolation);
}

}  // namespace
}  // namespace mvstudio::splats
