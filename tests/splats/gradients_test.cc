#include "avatar/splats/gradients.h"

#include <cmath>

#include "avatar/metrics/ssim.h"
#include "avatar/splats/colour.h"
#include "avatar/splats/train/loss.h"
#include "tests/splats/scenes.h"
#include "tests/support/test.h"

namespace mvstudio::splats {
namespace {

Truth<double> RandomTruth(int width, int height, uint64_t seed) {
  Rng rng(seed);
  Image image(width, height, 3), mask(width, height, 1);
  for (uint8_t& value : image.pixels) value = static_cast<uint8_t>(rng.Index(256));
  for (int y = 3; y < height - 2; ++y)
    for (int x = 4; x < width - 3; ++x) *mask.Pixel(x, y) = 255;
  return TruthOf<double>(image, mask);
}

double LossOf(const Scene& scene, const Truth<double>& truth, const LossWeights& weights, const RenderSettings& settings) {
  RasterImage<double> unused;
  return Loss(Draw(scene, settings).image, truth, weights, &unused).total;
}

Parameters<double> GradientOf(const Scene& scene, const Truth<double>& truth, const LossWeights& weights,
                              const RenderSettings& settings) {
  const testing::Drawn<double> drawn = Draw(scene, settings);
  RasterImage<double> by_image;
  Loss(drawn.image, truth, weights, &by_image);
  const auto by_splat = RasteriseBackward(drawn.projected.splats, drawn.tiles, drawn.image, by_image, 1);
  Parameters<double> out = ZeroParameters<double>(scene.cloud.size(), scene.cloud.values.degree);
  AddGradients(scene.cloud, scene.surface(), scene.view(), settings, drawn.projected.splats, by_splat, &out);
  return out;
}

/// Every number of every parameter against a central difference.
void ExpectGradients(Scene scene, const LossWeights& weights, const RenderSettings& settings) {
  const Truth<double> truth = RandomTruth(scene.camera.camera.width_px, scene.camera.camera.height_px, 7);
  const Parameters<double> gradient = GradientOf(scene, truth, weights, settings);
  std::vector<const std::vector<double>*> arrays;
  ForEachGroup(gradient, [&](Group, int, const std::vector<double>& array) { arrays.push_back(&array); });
  size_t group = 0;
  int moved = 0;
  ForEachGroup(scene.cloud.values, [&](Group, int, std::vector<double>& array) {
    for (size_t i = 0; i < array.size(); ++i) {
      constexpr double kStep = 1e-6;
      const double before = array[i];
      array[i] = before + kStep;
      const double above = LossOf(scene, truth, weights, settings);
      array[i] = before - kStep;
      const double below = LossOf(scene, truth, weights, settings);
      array[i] = before;
      const double expected = (above - below) / (2 * kStep), got = (*arrays[group])[i];
      EXPECT_NEAR(got, expected, 2e-8 + 1e-5 * std::abs(expected)) << "group " << group << ", number " << i;
      moved += std::abs(expected) > 1e-5;
    }
    ++group;
  });
  EXPECT_GT(moved, static_cast<int>(5 * scene.cloud.size()));
}

TEST(Gradients, OfAllParametersWithTheMipFilter) { ExpectGradients(RandomScene(14, 0, 1), {1, 0.5, 1}, {true, 1}); }
TEST(Gradients, OfAllParametersWithoutIt) { ExpectGradients(RandomScene(14, 0, 2), {1, 0.5, 1}, {false, 1}); }
TEST(Gradients, OfColoursOfDegreeOne) { ExpectGradients(RandomScene(10, 1, 3), {1, 0.5, 1}, {true, 1}); }
TEST(Gradients, OfColoursOfDegreeTwo) { ExpectGradients(RandomScene(10, 2, 4), {1, 0.5, 1}, {true, 1}); }

TEST(Gradients, WhereTheProjectionIsLinearisedAtTheEdge) {
  Scene scene = RandomScene(6, 0, 5);
  const geometry::Rigid3 world_from_cam = geometry::Inverse(scene.camera.cam_from_world);
  // Wide Gaussians whose middles lie beside the image.
  for (int k = 0; k < 3; ++k) scene.vertices.col(k) += world_from_cam.rotation * Eigen::Vector3d(1.6, 0.1, 0);
  for (int k = 3; k < 6; ++k) scene.vertices.col(k) += world_from_cam.rotation * Eigen::Vector3d(0, -1.4, 0);
  for (size_t k = 0; k < 6; ++k) scene.cloud.values.log_scale[k] = std::log(0.6);
  scene.cloud.values.opacity[0] = scene.cloud.values.opacity[1] = 2;
  const testing::Drawn<double> drawn = Draw(scene);
  ASSERT_EQ(drawn.projected.splats[0].index, 0);
  ASSERT_GT(drawn.projected.splats[0].x, scene.camera.camera.width_px * 1.15);
  ExpectGradients(scene, {1, 0.5, 1}, {true, 1});
}

TEST(Gradients, ViewSpaceIsTheLengthOfThatByThePlace) {
  const Scene scene = RandomScene(5, 0, 6);
  const testing::Drawn<double> drawn = Draw(scene);
  std::vector<SplatGradient<double>> by_splat(drawn.projected.splats.size());
  for (size_t i = 0; i < by_splat.size(); ++i) by_splat[i].x = 3, by_splat[i].y = -4;
  Parameters<double> out = ZeroParameters<double>(5, 0);
  std::vector<double> lengths(5, 1.0);
  AddGradients(scene.cloud, scene.surface(), scene.view(), {}, drawn.projected.splats, by_splat, &out, &lengths);
  for (const auto& splat : drawn.projected.splats) EXPECT_DOUBLE_EQ(lengths[static_cast<size_t>(splat.index)], 6);
}

/// Single precision follows double.
TEST(Gradients, InFloat) {
  const Scene scene = RandomScene(14, 1, 8);
  const Truth<double> truth = RandomTruth(26, 21, 7);
  const Parameters<double> expected = GradientOf(scene, truth, {}, {true, 1});
  const Cloud cloud = CloudCast<float>(scene.cloud);
  const Eigen::Matrix3Xf vertices = scene.vertices.cast<float>();
  const auto drawn = Draw<float>(cloud, {scene.faces, vertices}, ViewOf<float>(scene.camera), {true, 1});
  Truth<float> truth_float{
      truth.width, truth.height, {truth.rgb.begin(), truth.rgb.end()}, {truth.mask.begin(), truth.mask.end()}, truth.box};
  RasterImage<float> by_image;
  Loss(drawn.image, truth_float, {}, &by_image);
  const auto by_splat = RasteriseBackward(drawn.projected.splats, drawn.tiles, drawn.image, by_image, 1);
  Parameters<float> got = ZeroParameters<float>(cloud.size(), 1);
  AddGradients<float>(cloud, {scene.faces, vertices}, ViewOf<float>(scene.camera), {true, 1}, drawn.projected.splats, by_splat,
                      &got);
  std::vector<const std::vector<float>*> arrays;
  ForEachGroup(got, [&](Group, int, const std::vector<float>& array) { arrays.push_back(&array); });
  size_t group = 0;
  ForEachGroup(expected, [&](Group, int, const std::vector<double>& array) {
    double most = 0;
    for (const double value : array) most = std::max(most, std::abs(value));
    for (size_t i = 0; i < array.size(); ++i)
      EXPECT_NEAR((*arrays[group])[i], array[i], 1e-4 * most) << "group " << group << ", number " << i;
    ++group;
  });
}

TEST(Loss, GradientByEachValueOfTheImage) {
  const Truth<double> truth = RandomTruth(19, 17, 3);
  Rng rng(4);
  RasterImage<double> image{19, 17, std::vector<double>(4 * 19 * 17)};
  for (double& value : image.values) value = rng.Uniform();
  const LossWeights weights{0.7, 1.3, 0.9};
  RasterImage<double> by_image, unused;
  const LossTerms terms = Loss(image, truth, weights, &by_image);
  EXPECT_NEAR(terms.total, 0.7 * terms.l1 + 1.3 * terms.ssim + 0.9 * terms.mask, 1e-12);
  for (size_t i = 0; i < image.values.size(); ++i) {
    constexpr double kStep = 1e-6;
    RasterImage<double> moved = image;
    moved.values[i] += kStep;
    const double above = Loss(moved, truth, weights, &unused).total;
    moved.values[i] -= 2 * kStep;
    const double below = Loss(moved, truth, weights, &unused).total;
    EXPECT_NEAR(by_image.values[i], (above - below) / (2 * kStep), 1e-8);
  }
}

TEST(Loss, IsNothingForTheTruth) {
  const Truth<double> truth = RandomTruth(24, 20, 9);
  RasterImage<double> image{24, 20, truth.rgb};
  image.values.insert(image.values.end(), truth.mask.begin(), truth.mask.end());
  RasterImage<double> by_image;
  const LossTerms terms = Loss(image, truth, {}, &by_image);
  EXPECT_NEAR(terms.total, 0, 1e-12);
  for (const double value : by_image.values) EXPECT_NEAR(value, 0, 1e-12);
}

TEST(Loss, SsimIsThatOfTheMetrics) {
  const Truth<double> truth = RandomTruth(30, 28, 11);
  Rng rng(12);
  RasterImage<double> image{30, 28, std::vector<double>(4 * 30 * 28)};
  metrics::PlanarImage a{truth.box.x1 - truth.box.x0, truth.box.y1 - truth.box.y0, 3, 1, {}}, b = a;
  for (double& value : image.values) value = rng.Uniform();
  for (int c = 0; c < 3; ++c)
    for (int y = truth.box.y0; y < truth.box.y1; ++y)
      for (int x = truth.box.x0; x < truth.box.x1; ++x) {
        const size_t at = static_cast<size_t>(y) * 30 + x;
        a.samples.push_back(image.Plane(c)[at]), b.samples.push_back(truth.rgb[static_cast<size_t>(c) * 30 * 28 + at]);
      }
  const metrics::SsimMap map = metrics::ComputeSsimMap(a, b);
  double mean = 0;
  for (const double value : map.values) mean += value / static_cast<double>(map.values.size());
  RasterImage<double> unused;
  EXPECT_NEAR(Loss(image, truth, {}, &unused).ssim, 1 - mean, 1e-10);
}

TEST(Colour, BasisGradientIsItsDifference) {
  const Eigen::Vector3d d = Eigen::Vector3d(0.3, -0.5, 0.7).normalized();
  double gradient[27];
  EvaluateBasisGradient<double>(d, 2, gradient);
  for (int axis = 0; axis < 3; ++axis) {
    Eigen::Vector3d step = Eigen::Vector3d::Zero();
    step[axis] = 1e-6;
    double above[9], below[9];
    EvaluateBasis<double>(d + step, 2, above), EvaluateBasis<double>(d - step, 2, below);
    for (int k = 0; k < 9; ++k) EXPECT_NEAR(gradient[3 * k + axis], (above[k] - below[k]) / 2e-6, 1e-9);
  }
}

TEST(Colour, BasisIsOrthonormalOnTheSphere) {
  // The 26 points of a quadrature that is exact to degree 7 (Lebedev): faces, edges and corners of a cube.
  double products[9][9] = {};
  for (int x = -1; x <= 1; ++x)
    for (int y = -1; y <= 1; ++y)
      for (int z = -1; z <= 1; ++z) {
        const int n = x * x + y * y + z * z;
        if (n == 0) continue;
        const double weight = (n == 1 ? 1.0 / 21 : n == 2 ? 4.0 / 105 : 27.0 / 840) * 4 * 3.14159265358979323846;
        double basis[9];
        EvaluateBasis<double>(Eigen::Vector3d(x, y, z).normalized(), 2, basis);
        for (int i = 0; i < 9; ++i)
          for (int k = 0; k < 9; ++k) products[i][k] += weight * basis[i] * basis[k];
      }
  for (int i = 0; i < 9; ++i)
    for (int k = 0; k < 9; ++k) EXPECT_NEAR(products[i][k], i == k ? 1 : 0, 1e-12) << i << ", " << k;
}

TEST(Colour, RotatedCoefficientsGiveTheSameColours) {
  Rng rng(2);
  for (int degree = 0; degree <= 2; ++degree) {
    const Eigen::Matrix3d b_from_a = geometry::RotationExp({rng.Normal(), rng.Normal(), rng.Normal()}).toRotationMatrix();
    double in_a[9], in_b[9];
    for (double& value : in_a) value = rng.Normal();
    RotateCoefficients(b_from_a, degree, in_a, in_b);
    for (int trial = 0; trial < 20; ++trial) {
      const Eigen::Vector3d d = Eigen::Vector3d(rng.Normal(), rng.Normal(), rng.Normal()).normalized();
      double basis_a[9], basis_b[9], value_a = 0, value_b = 0;
      EvaluateBasis<double>(d, degree, basis_a), EvaluateBasis<double>(b_from_a * d, degree, basis_b);
      for (int k = 0; k < BasisSize(degree); ++k) value_a += basis_a[k] * in_a[k], value_b += basis_b[k] * in_b[k];
      EXPECT_NEAR(value_a, value_b, 1e-12);
    }
  }
}

}  // namespace
}  // namespace mvstudio::splats
