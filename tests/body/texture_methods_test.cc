#include <cmath>
#include <limits>

#include "avatar/body/texture/bake.h"
#include "avatar/body/texture/level_seams.h"
#include "avatar/body/texture/refine.h"
#include "avatar/body/texture/unsharp.h"
#include "avatar/body/texture/view_choice.h"
#include "core/error.h"
#include "core/random.h"
#include "tests/body/fit_studio.h"
#include "tests/body/posed.h"
#include "tests/support/test.h"

namespace mvstudio::body {
namespace {

constexpr int kChartPx = 32;

/// The body at rest in a coat, from `count` sides.
std::vector<TextureView> ViewsOf(const BodyTemplate& body, const Textures& coat, int count, int size_px) {
  std::vector<TextureView> views;
  for (int k = 0; k < count; ++k) {
    const geometry::RigCamera camera = CameraAt(2 * M_PI * k / count, k % 3 == 0 ? 2.4 : 1.0, size_px);
    RenderedBody rendered = RenderBody(body, coat, body.vertices, camera);
    views.push_back({camera, rendered.image, rendered.cover, body.vertices, k});
  }
  return views;
}

TextureView PlainView(const BodyTemplate& body, double angle_rad, uint8_t level) {
  const geometry::RigCamera camera = CameraAt(angle_rad, 1, 200);
  Image image(200, 200, 3, level);
  return {camera, image, Image(200, 200, 1, 255), body.vertices, 0};
}

double PsnrDb(const BodyTemplate& body, const Textures& a, const Textures& b, const geometry::RigCamera& camera) {
  const Image one = RenderBody(body, a, body.vertices, camera).image, other = RenderBody(body, b, body.vertices, camera).image;
  double sum = 0;
  int count = 0;
  for (size_t i = 0; i < one.pixels.size(); ++i) {
    if (one.pixels[i] == 0) continue;
    sum += std::pow(one.pixels[i] - other.pixels[i], 2), ++count;
  }
  return 10 * std::log10(255.0 * 255.0 * count / sum);
}

Textures Plain(uint8_t level, int size_px = kChartPx) {
  Textures textures;
  textures.fill(Image(size_px, size_px, 3, level));
  return textures;
}

class TextureMethods : public ::testing::Test {
 protected:
  const BodyTemplate body_ = MakeMannequin(1.75, 0.6);
};

TEST_F(TextureMethods, TheMedianDoesNotFollowAMinority) {
  TextureBaker baker(body_, kChartPx);
  for (const int level : {30, 10, 200, 20, 250}) baker.Add(PlainView(body_, 0.2, static_cast<uint8_t>(level)), {});
  const Textures median = baker.FinishMedian({Eigen::Array3d::Ones()});
  for (const Image& chart : median) EXPECT_THAT(chart.pixels, ::testing::Each(30));
}

TEST_F(TextureMethods, WithoutViewsEveryMethodIsGrey) {
  const TextureBaker baker(body_, kChartPx);
  EXPECT_EQ(baker.FinishMedian({})[3].pixels, Plain(128)[3].pixels);
  const ViewChoice choice = ChooseViews(body_, {}, {}, {});
  EXPECT_THAT(choice.view_of_face, ::testing::Each(-1));
  EXPECT_EQ(BakeChosenViews(body_, {}, choice, kChartPx, true, {})[3].pixels, Plain(128)[3].pixels);
  RefineReport report;
  EXPECT_EQ(TextureRefiner(body_, kChartPx).Refine(Plain(7), {}, {}, &report)[3].pixels, Plain(7)[3].pixels);
  EXPECT_EQ(report.pixels, 0);
  EXPECT_TRUE(std::isnan(report.loss_after));
}

TEST_F(TextureMethods, BodiesThatAreNotFiniteShowNothing) {
  TextureView view = PlainView(body_, 0, 90);
  view.vertices_in_world.setConstant(std::numeric_limits<float>::quiet_NaN());
  TextureBaker baker(body_, kChartPx);
  baker.Add(view, {});
  EXPECT_EQ(baker.SeenShare(), 0);
  EXPECT_THAT(ChooseViews(body_, {view}, {}, {}).view_of_face, ::testing::Each(-1));
  TextureRefiner refiner(body_, kChartPx);
  refiner.Add(view);
  EXPECT_EQ(refiner.num_pixels(), 0);
}

TEST_F(TextureMethods, ChartsOfOneTexelAreRefused) {
  EXPECT_THROW(TextureBaker(body_, 1), ContractViolation);
  EXPECT_THROW(TextureRefiner(body_, 1), ContractViolation);
  EXPECT_THROW(BakeChosenViews(body_, {}, ViewChoice{}, 1, true, {}), ContractViolation);
}

TEST_F(TextureMethods, OfOneViewTheFacesTakeThatViewOrNone) {
  const ViewChoice choice = ChooseViews(body_, {PlainView(body_, 0, 77)}, {}, {});
  EXPECT_EQ(choice.num_views, 1);
  EXPECT_EQ(choice.seam_m, 0);
  EXPECT_THAT(choice.view_of_face, ::testing::Contains(0));
  EXPECT_THAT(choice.view_of_face, ::testing::Contains(-1)) << "its back";
  const Textures baked = BakeChosenViews(body_, {PlainView(body_, 0, 77)}, choice, kChartPx, true, {});
  for (const Image& chart : baked) EXPECT_THAT(chart.pixels, ::testing::Each(77));
}

TEST_F(TextureMethods, WithoutAPriceOfSeamsEachFaceTakesItsBestView) {
  const std::vector<TextureView> views = ViewsOf(body_, MannequinTextures(kChartPx, 5), 6, 200);
  ViewChoiceOptions options;
  options.seam_price = 0;
  const ViewChoice free = ChooseViews(body_, views, options, {});
  EXPECT_EQ(free.energy, 0);
  options.seam_price = 3;
  const ViewChoice dear = ChooseViews(body_, views, options, {});
  EXPECT_LT(dear.energy, dear.energy_of_best);
  EXPECT_LT(dear.seam_m, 0.9 * free.seam_m) << "few faces are seen by more than two of six views";
}

TEST_F(TextureMethods, ChosenViewsBringTheColoursBack) {
  const Textures truth = MannequinTextures(kChartPx, 5);
  const std::vector<TextureView> views = ViewsOf(body_, truth, 12, 300);
  const ViewChoice choice = ChooseViews(body_, views, {}, {});
  const geometry::RigCamera camera = CameraAt(0.3, 1.4, 200);
  EXPECT_GT(PsnrDb(body_, truth, BakeChosenViews(body_, views, choice, kChartPx, true, {}), camera), 22);
}

TEST(LevelSeams, HalvesTheDifferenceOfTwoViews) {
  const BodyTemplate flag = Flag();
  const auto colour = [](int, int view) { return Eigen::Vector3f(view == 0 ? 100 : 120, 50, view == 0 ? 80 : 40); };
  const SeamCorrections seams = LevelSeams(flag, {0, 1}, colour);
  for (const Eigen::Vector3f& at : {Eigen::Vector3f(1, 0, 0), Eigen::Vector3f(0.2f, 0.3f, 0.5f)}) {
    EXPECT_LT((seams.At(0, at) - Eigen::Vector3f(10, 0, -20)).norm(), 0.1);
    EXPECT_LT((seams.At(1, at) - Eigen::Vector3f(-10, 0, 20)).norm(), 0.1);
  }
  const SeamCorrections one = LevelSeams(flag, {0, -1}, colour);
  EXPECT_EQ(one.At(0, {1, 0, 0}).norm(), 0);
  EXPECT_EQ(one.At(1, {1, 0, 0}).norm(), 0);
  const auto unknown = [](int, int) { return Eigen::Vector3f::Constant(std::nanf("")).eval(); };
  EXPECT_EQ(LevelSeams(flag, {0, 1}, unknown).At(0, {1, 0, 0}).norm(), 0);
}

TEST_F(TextureMethods, RefinementRecoversAKnownCoatFromGrey) {
  const Textures truth = MannequinTextures(kChartPx, 5);
  TextureRefiner refiner(body_, kChartPx);
  for (const TextureView& view : ViewsOf(body_, truth, 12, 240)) refiner.Add(view);
  RefineOptions options;
  options.steps = 120, options.smooth = 0, options.towards_start = 0;
  RefineReport report;
  const Textures refined = refiner.Refine(Plain(128), options, {}, &report);
  EXPECT_GT(report.loss_before, 20);
  EXPECT_LT(report.loss_after, 2);
  EXPECT_GT(PsnrDb(body_, truth, refined, CameraAt(2 * M_PI / 12, 1.0, 200)), 34) << "a side that was seen";
}

TEST_F(TextureMethods, TexelsThatNobodySeesKeepTheirColours) {
  TextureRefiner refiner(body_, kChartPx);
  refiner.Add(PlainView(body_, 0, 200));
  RefineReport report;
  RefineOptions options;
  options.smooth = 0;
  const Textures refined = refiner.Refine(Plain(60), options, {}, &report);
  size_t kept = 0, reached = 0, others = 0;
  for (const Image& chart : refined) {
    for (const uint8_t value : chart.pixels) kept += value == 60, reached += std::abs(value - 200) <= 2, others += value < 50;
  }
  EXPECT_GT(kept, 0.3 * 24 * 3 * kChartPx * kChartPx);
  EXPECT_GT(reached, 0.1 * 24 * 3 * kChartPx * kChartPx);
  EXPECT_EQ(others, 0u) << "texels between a pixel's places may overshoot a little";
}

TEST_F(TextureMethods, TheGradientIsThatOfFiniteDifferences) {
  TextureRefiner refiner(body_, 8);
  refiner.Add(ViewsOf(body_, MannequinTextures(8, 2), 1, 80)[0]);
  Rng rng(4);
  std::vector<float> texels(24 * 64), way(texels.size()), gradient, unused;
  for (int channel = 0; channel < 3; ++channel) {
    for (size_t t = 0; t < texels.size(); ++t)
      texels[t] = static_cast<float>(rng.Uniform()), way[t] = static_cast<float>(rng.Normal());
    refiner.Loss(channel, texels, &gradient);
    double slope = 0;
    for (size_t t = 0; t < texels.size(); ++t) slope += double{gradient[t]} * way[t];
    constexpr float kStep = 2e-4f;
    std::vector<float> ahead = texels, behind = texels;
    for (size_t t = 0; t < texels.size(); ++t) ahead[t] += kStep * way[t], behind[t] -= kStep * way[t];
    const double difference =
        (refiner.Loss(channel, ahead, &unused) - refiner.Loss(channel, behind, &unused)) / (2 * double{kStep});
    EXPECT_NEAR(slope, difference, 0.01 * std::abs(difference) + 0.05);
  }
}

TEST(ResizedTextures, PlainChartsStayPlainAndTheSameSizeStaysTheSame) {
  for (const int size : {2, 5, 31, 32, 90}) EXPECT_EQ(ResizedTextures(Plain(93), size)[7].pixels, Plain(93, size)[7].pixels);
  const Textures coat = MannequinTextures(kChartPx, 3);
  EXPECT_EQ(ResizedTextures(coat, kChartPx)[2].pixels, coat[2].pixels);
  Textures ramp = Plain(0, 64);
  for (int i = 0; i < 64 * 64; ++i) ramp[0].pixels[3 * i] = static_cast<uint8_t>(3 * (i % 64));
  const Image half = ResizedTextures(ramp, 32)[0];
  for (int x = 1; x < 31; ++x) EXPECT_NEAR(*half.Pixel(x, 9), 3 * (2 * x + 0.5), 1);
}

TEST(SharpenInMask, PlainImagesStayAsTheyAreBesideAnyBackground) {
  Image image(64, 1024, 3, 255), mask(64, 1024, 1, 0);
  for (int y = 100; y < 900; ++y) {
    for (int x = 10; x < 50; ++x) std::fill_n(image.Pixel(x, y), 3, 100), *mask.Pixel(x, y) = 255;
  }
  for (const double amount : {0.0, 0.75, 3.0, 100.0}) EXPECT_EQ(SharpenInMask(image, mask, amount).pixels, image.pixels);
}

/// The same by a sum over the window.
double SharpenedByHand(const Image& image, const Image& mask, int x, int y, int c, double amount) {
  double sum = 0, weights = 0;
  for (int dy = -8; dy <= 8; ++dy) {
    for (int dx = -8; dx <= 8; ++dx) {
      const int sx = x + dx, sy = y + dy;
      if (sx < 0 || sy < 0 || sx >= image.width || sy >= image.height || *mask.Pixel(sx, sy) < 128) continue;
      const double weight = std::exp(-0.5 * (dx * dx + dy * dy) / (2.9 * 2.9));
      sum += weight * image.Pixel(sx, sy)[c], weights += weight;
    }
  }
  const double value = image.Pixel(x, y)[c];
  return std::clamp(value + amount * (value - sum / weights), 0.0, 255.0);
}

TEST(SharpenInMask, IsTheSumOverTheWindow) {
  Rng rng(9);
  Image image(1024, 24, 3), mask(1024, 24, 1);
  for (uint8_t& value : image.pixels) value = static_cast<uint8_t>(rng.Index(256));
  for (uint8_t& value : mask.pixels) value = rng.Uniform() < 0.7 ? 255 : 0;
  const Image sharp = SharpenInMask(image, mask, 1.5);
  for (int k = 0; k < 500; ++k) {
    const int x = static_cast<int>(rng.Index(1024)), y = static_cast<int>(rng.Index(24)), c = static_cast<int>(rng.Index(3));
    const double wanted = *mask.Pixel(x, y) < 128 ? image.Pixel(x, y)[c] : SharpenedByHand(image, mask, x, y, c, 1.5);
    EXPECT_NEAR(sharp.Pixel(x, y)[c], wanted, 0.51);
  }
}

TEST(SharpenInMask, AtExtremes) {
  EXPECT_TRUE(SharpenInMask(Image(0, 0, 3), Image(0, 0, 1), 1).empty());
  EXPECT_THAT(SharpenInMask(Image(1, 1, 3, 9), Image(1, 1, 1, 255), 3).pixels, ::testing::Each(9));
  EXPECT_THROW(SharpenInMask(Image(2, 2, 3), Image(2, 2, 1), std::nan("")), ContractViolation);
  EXPECT_THROW(SharpenInMask(Image(2, 2, 3), Image(3, 2, 1), 1), ContractViolation);
}

}  // namespace
}  // namespace mvstudio::body
