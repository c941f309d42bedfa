#include "avatar/scores/features.h"

#include <ATen/ATen.h>

#include <cmath>
#include <limits>

#include "avatar/scores/set_distance.h"
#include "core/error.h"
#include "core/random.h"
#include "tests/support/test.h"

namespace mvstudio::avatar {
namespace {

at::Tensor Blur(const at::Tensor& x, double sigma) {
  const int r = static_cast<int>(std::ceil(3 * sigma));
  at::Tensor k = at::exp(-at::arange(-r, r + 1, at::kDouble).square() / (2 * sigma * sigma));
  k = k / k.sum();
  const at::Tensor flat = x.reshape({-1, 1, x.size(2), x.size(3)});
  const at::Tensor rows = at::conv2d(at::replication_pad2d(flat, {r, r, 0, 0}), k.view({1, 1, 1, -1}));
  return at::conv2d(at::replication_pad2d(rows, {0, 0, r, r}), k.view({1, 1, -1, 1})).view(x.sizes());
}

// Striped discs on black at random places: a crude person in front of nothing.
at::Tensor RandomImages(int64_t n, uint64_t seed) {
  Rng rng(seed);
  at::Tensor x = at::zeros({n, 3, 64, 64}, at::kDouble);
  auto p = x.accessor<double, 4>();
  for (int64_t i = 0; i < n; ++i) {
    const double cx = rng.Uniform(24, 40), cy = rng.Uniform(24, 40), radius = rng.Uniform(14, 20), angle = rng.Uniform(0, 3);
    for (int y = 0; y < 64; ++y) {
      for (int c = 0; c < 64; ++c) {
        if (std::hypot(c - cx, y - cy) > radius) continue;
        const double wave = std::sin(1.4 * (c * std::cos(angle) + y * std::sin(angle)));
        for (int k = 0; k < 3; ++k)
          p[i][k][y][c] = std::min(1.0, std::max(0.0, 0.5 + (0.3 - 0.1 * k) * wave + 0.02 * rng.Normal()));
      }
    }
  }
  return x;
}

TEST(GaborFeatures, HaveTheirSizeAndDoNotDependOnTheBatch) {
  const at::Tensor x = RandomImages(19, 1), f = GaborFeatures(x);
  ASSERT_EQ(f.sizes(), (at::IntArrayRef{19, kGaborFeatureSize}));
  EXPECT_TRUE(at::isfinite(f).all().item<bool>());
  EXPECT_LE((f.slice(0, 17, 18) - GaborFeatures(x.slice(0, 17, 18))).abs().max().item<double>(), 1e-12);
  EXPECT_TRUE(at::equal(f, GaborFeatures(x)));
}

TEST(GaborFeatures, FlatImagesGiveTheClosedForm) {
  const at::Tensor f = GaborFeatures(at::full({1, 3, 48, 40}, 0.25, at::kDouble))[0];
  // float32 filters leave about 1e-8 of 0.25, against a floor of 1e-3
  EXPECT_LE((f.slice(0, 0, 144) - std::log(1e-3)).abs().max().item<double>(), 1e-4) << "no energy anywhere";
  EXPECT_LE(f.slice(0, 144, 234).abs().max().item<double>(), 1e-6) << "no correlation";
  EXPECT_NEAR(f[234].item<double>(), 0.25, 1e-12);
  EXPECT_NEAR(f[235].item<double>(), 0, 1e-12);
}

TEST(GaborFeatures, AStripeAnswersInItsOrientationAndOctave) {
  const at::Tensor row = (at::arange(64, at::kDouble) * (3.14159265358979 / 2)).cos() * 0.5 + 0.5;  // wavelength 4 px along x
  const at::Tensor f = GaborFeatures(row.expand({1, 3, 64, 64}).contiguous())[0];
  const at::Tensor luma = f.slice(0, 0, 6);  // octave 0: 18 means (3 channels x 6 orientations), then 18 deviations
  EXPECT_EQ(luma.argmax().item<int64_t>(), 0);
  EXPECT_GT(f[0].item<double>() - f[36].item<double>(), 0.5) << "octave 1 sees less of it";
}

TEST(GaborFeatures, DistanceIsMonotoneUnderBlurAndNoise) {
  const at::Tensor x = RandomImages(24, 2), real = GaborFeatures(x);
  double last = 0, last_kid = -1;
  for (const double sigma : {0.5, 1.0, 2.0, 4.0}) {
    const at::Tensor blurred = GaborFeatures(Blur(x, sigma));
    const double fd = FrechetDistance(real, blurred), kid = KernelInceptionDistance(real, blurred).value;
    EXPECT_GT(fd, last) << "blur " << sigma;
    EXPECT_GT(kid, last_kid) << "blur " << sigma;
    last = fd, last_kid = kid;
  }
  Rng rng(3);
  at::Tensor noise = at::empty_like(x);
  for (int64_t i = 0; i < noise.numel(); ++i) noise.data_ptr<double>()[i] = rng.Normal();
  last = 0;
  for (const double sigma : {0.02, 0.05, 0.1, 0.2}) {
    const double fd = FrechetDistance(real, GaborFeatures((x + sigma * noise).clamp(0, 1)));
    EXPECT_GT(fd, last) << "noise " << sigma;
    last = fd;
  }
}

TEST(GaborFeatures, UnrelatedImagesOfTheSameKindAreNearerThanDegradedOnes) {
  const at::Tensor a = RandomImages(24, 4), b = RandomImages(24, 5), real = GaborFeatures(a);
  const double same = FrechetDistance(real, GaborFeatures(b));
  EXPECT_GT(FrechetDistance(real, GaborFeatures(Blur(b, 1.0))), 1.5 * same);
  EXPECT_LT(FrechetSplitHalfFloor(GaborFeatures(at::cat({a, b}))), FrechetDistance(real, GaborFeatures(Blur(b, 1.0))));
}

TEST(GaborFeatures, RefuseSmallImagesAndNan) {
  EXPECT_THROW(GaborFeatures(at::zeros({1, 3, 31, 64})), ContractViolation);
  EXPECT_THROW(GaborFeatures(at::zeros({1, 1, 64, 64})), ContractViolation);
  at::Tensor bad = at::zeros({1, 3, 32, 32});
  bad[0][0][0][0] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THROW(GaborFeatures(bad), ContractViolation);
}

}  // namespace
}  // namespace mvstudio::avatar
