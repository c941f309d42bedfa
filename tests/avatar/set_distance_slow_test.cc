// The Fréchet distance at the size of Inception's features.
#include <ATen/ATen.h>

#include "avatar/scores/set_distance.h"
#include "tests/support/test.h"

namespace mvstudio::avatar {
namespace {

constexpr int64_t kDimensions = 2048;

/// Features as after a ReLU and a mean over the image, correlated.
at::Tensor Features(int64_t n, uint64_t seed) {
  at::manual_seed(seed);
  const at::Tensor mixing = at::randn({64, kDimensions}, at::kDouble) / 8;
  at::manual_seed(seed + 1000 * static_cast<uint64_t>(n));
  return (at::randn({n, 64}, at::kDouble).matmul(mixing) + 0.3 * at::randn({n, kDimensions}, at::kDouble) + 0.2).relu();
}

TEST(FrechetSlow, SelfDistanceVanishesFromFewSamplesToTwiceTheDimensions) {
  for (const int64_t n : {50, 300, 1500, 2048, 4096}) {
    const at::Tensor x = Features(n, 1);
    const double trace = (x - x.mean(0)).square().sum().item<double>() / static_cast<double>(n - 1);
    const double distance = FrechetDistance(x, x);
    EXPECT_GE(distance, 0) << n;
    EXPECT_LE(distance, 1e-12 * trace) << n;
  }
}

/// A scale s of centred features changes the distance by (s - 1)^2 of the trace, whatever their covariance is.
TEST(FrechetSlow, ScaledSetsHaveAClosedForm) {
  for (const int64_t n : {50, 1500, 4096}) {
    at::Tensor x = Features(n, 2);
    x = x - x.mean(0);
    const double trace = x.square().sum().item<double>() / static_cast<double>(n - 1);
    EXPECT_NEAR(FrechetDistance(x, 1.5 * x + 0.01) / (0.25 * trace + kDimensions * 1e-4), 1, 1e-12) << n;
  }
}

}  // namespace
}  // namespace mvstudio::avatar
