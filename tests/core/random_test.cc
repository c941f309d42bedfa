#include "core/random.h"

#include <vector>

#include "tests/support/test.h"

namespace mvstudio {
namespace {

constexpr int kCount = 1000000;

TEST(Rng, IsSplitMix64) {
  // First outputs of Vigna's reference splitmix64.c for the seed 1234567.
  Rng rng(1234567);
  for (const uint64_t expected : {6457827717110365317ull, 3203168211198807973ull, 9817491932198370423ull,
                                  4593380528125082431ull, 16408922859458223821ull}) {
    EXPECT_EQ(rng.Next(), expected);
  }
}

TEST(Rng, SameSeedSameNumbers) {
  Rng a(42), b(42), c(43);
  for (int i = 0; i < 100; ++i) EXPECT_EQ(a.Normal(), b.Normal());
  EXPECT_NE(a.Next(), c.Next());
}

/// Each bound below is five standard errors of the moment.
TEST(Rng, UniformMoments) {
  Rng rng(1);
  double sum = 0, squares = 0;
  for (int i = 0; i < kCount; ++i) {
    const double x = rng.Uniform();
    ASSERT_TRUE(x >= 0 && x < 1);
    sum += x, squares += x * x;
  }
  EXPECT_NEAR(sum / kCount, 0.5, 5 * std::sqrt(1.0 / 12 / kCount));
  EXPECT_NEAR(squares / kCount, 1.0 / 3, 5 * std::sqrt(4.0 / 45 / kCount));
}

TEST(Rng, NormalMoments) {
  Rng rng(2);
  double moments[5] = {};
  double lag = 0, last = 0;
  for (int i = 0; i < kCount; ++i) {
    const double x = rng.Normal();
    ASSERT_TRUE(std::isfinite(x));
    double power = 1;
    for (double& moment : moments) moment += power / kCount, power *= x;
    lag += x * last / kCount;
    last = x;
  }
  EXPECT_NEAR(moments[1], 0, 5 / std::sqrt(kCount));
  EXPECT_NEAR(moments[2], 1, 5 * std::sqrt(2.0 / kCount));
  EXPECT_NEAR(moments[3], 0, 5 * std::sqrt(15.0 / kCount));
  EXPECT_NEAR(moments[4], 3, 5 * std::sqrt(96.0 / kCount));
  EXPECT_NEAR(lag, 0, 5 / std::sqrt(kCount)) << "neighbours are uncorrelated";
}

TEST(Rng, IndexIsUniform) {
  Rng rng(3);
  std::vector<int> counts(7);
  for (int i = 0; i < 700000; ++i) ++counts.at(static_cast<size_t>(rng.Index(7)));
  double chi_squared = 0;
  for (const int count : counts) chi_squared += (count - 1e5) * (count - 1e5) / 1e5;
  EXPECT_LT(chi_squared, 33.1) << "6 degrees of freedom, 1e-5 quantile";
}

}  // namespace
}  // namespace mvstudio
