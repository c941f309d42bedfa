#include "avatar/scores/set_distance.h"

#include <ATen/ATen.h>

#include <cmath>
#include <functional>
#include <limits>

#include "core/error.h"
#include "core/random.h"
#include "tests/support/test.h"

namespace mvstudio::avatar {
namespace {

at::Tensor Noise(at::IntArrayRef sizes, uint64_t seed, double mean = 0, double sigma = 1) {
  Rng rng(seed);
  at::Tensor x = at::empty(sizes, at::kDouble);
  double* p = x.data_ptr<double>();
  for (int64_t i = 0; i < x.numel(); ++i) p[i] = mean + sigma * rng.Normal();
  return x;
}

// Samples whose mean is exactly 0 and whose covariance (n - 1) is exactly the identity, up to rounding.
at::Tensor Whitened(int64_t n, int64_t d, uint64_t seed) {
  at::Tensor x = Noise({n, d}, seed);
  x = x - x.mean(0);
  return std::get<0>(at::linalg_qr(x)) * std::sqrt(static_cast<double>(n - 1));
}

TEST(Frechet, ClosedFormForDiagonalGaussians) {
  const int64_t d = 7;
  const at::Tensor s1 = at::linspace(0.5, 2, d, at::kDouble), s2 = at::linspace(3, 0.1, d, at::kDouble);
  const at::Tensor shift = at::linspace(-1, 2, d, at::kDouble);
  const at::Tensor x = Whitened(50, d, 1) * s1, y = Whitened(80, d, 2) * s2 + shift + 100;
  const double expected = (shift + 100).square().sum().item<double>() + (s1 - s2).square().sum().item<double>();
  for (const auto form : {FrechetForm::kAuto, FrechetForm::kNuclear, FrechetForm::kQr, FrechetForm::kEigen}) {
    EXPECT_NEAR(FrechetDistance(x, y, form) / expected, 1.0, 1e-13);
  }
}

TEST(Frechet, ClosedFormForCorrelatedGaussiansInThePlane) {
  const at::Tensor a = at::tensor({2.0, 0.3, -0.7, 0.5}, at::kDouble).view({2, 2});
  const at::Tensor b = at::tensor({0.4, 1.1, 0.9, -0.2}, at::kDouble).view({2, 2});
  const at::Tensor x = Whitened(40, 2, 3).matmul(a), y = Whitened(60, 2, 4).matmul(b);
  const at::Tensor s1 = a.t().matmul(a), s2 = b.t().matmul(b);
  const auto det = [](const at::Tensor& m) { return (m[0][0] * m[1][1] - m[0][1] * m[1][0]).item<double>(); };
  const double cross = std::sqrt(s1.matmul(s2).diagonal().sum().item<double>() + 2 * std::sqrt(det(s1) * det(s2)));
  const double expected = (s1 + s2).diagonal().sum().item<double>() - 2 * cross;
  for (const auto form : {FrechetForm::kNuclear, FrechetForm::kQr, FrechetForm::kEigen}) {
    EXPECT_NEAR(FrechetDistance(x, y, form), expected, 1e-12);
  }
}

TEST(Frechet, SelfDistanceVanishesAlsoForSingularCovariances) {
  const at::Tensor x = Noise({20, 100}, 5, 10);
  EXPECT_LE(FrechetDistance(x, x), 1e-12);
  EXPECT_GE(FrechetDistance(x, x), 0);
  EXPECT_LE(FrechetDistance(Noise({200, 10}, 6), Noise({200, 10}, 6)), 1e-12);
  const at::Tensor flat = at::ones({30, 4}, at::kDouble);
  EXPECT_LE(FrechetDistance(flat, flat), 1e-12);
  EXPECT_NEAR(FrechetDistance(flat, flat + 2), 16, 1e-12);
}

TEST(Frechet, FormsAgreeOnBothSidesOfTheDimension) {
  for (const int64_t n : {8, 30, 200}) {
    const at::Tensor x = Noise({n, 20}, 7).relu(), y = (Noise({n + 5, 20}, 8) * 1.3 + 0.1).relu();
    const double nuclear = FrechetDistance(x, y, FrechetForm::kNuclear);
    EXPECT_NEAR(FrechetDistance(x, y, FrechetForm::kQr), nuclear, 1e-11) << n;
    EXPECT_NEAR(FrechetDistance(x, y, FrechetForm::kEigen), nuclear, n > 20 ? 1e-11 : 1e-5) << n;
    EXPECT_NEAR(FrechetDistance(y, x), nuclear, 1e-11);
    EXPECT_NEAR(FrechetDistance(x.flip(0), y), nuclear, 1e-11);
  }
}

TEST(Frechet, SurvivesALargeCommonOffset) {
  const at::Tensor x = Noise({60, 12}, 9), y = Noise({60, 12}, 10) * 1.2;
  EXPECT_NEAR(FrechetDistance(x + 1e6, y + 1e6), FrechetDistance(x, y), 1e-6);
}

TEST(Frechet, RefusesTooFewSamplesAndNan) {
  const at::Tensor x = Noise({5, 3}, 11);
  EXPECT_THROW(FrechetDistance(x.slice(0, 0, 1), x), ContractViolation);
  EXPECT_THROW(FrechetDistance(x, Noise({5, 4}, 12)), ContractViolation);
  at::Tensor bad = x.clone();
  bad[2][1] = std::numeric_limits<double>::infinity();
  EXPECT_THROW(FrechetDistance(x, bad), ContractViolation);
  EXPECT_THROW(FrechetDistance(x * 1e200, x * 1e200), ContractViolation) << "not 0";
  EXPECT_THROW(FrechetSplitHalfFloor(x.slice(0, 0, 3)), ContractViolation);
  EXPECT_THROW(KernelInceptionDistance(x, x.slice(0, 0, 2)), ContractViolation);
}

TEST(Frechet, FloorIsSeededAndFallsWithTheNumberOfSamples) {
  const at::Tensor few = Noise({40, 16}, 13), many = Noise({640, 16}, 14);
  EXPECT_EQ(FrechetSplitHalfFloor(few, 3), FrechetSplitHalfFloor(few, 3));
  EXPECT_NE(FrechetSplitHalfFloor(few, 3), FrechetSplitHalfFloor(few, 4));
  EXPECT_GT(FrechetSplitHalfFloor(few), 5 * FrechetSplitHalfFloor(many));
}

TEST(KernelDistance, EqualsTheDoubleSum) {
  const int64_t n = 6, m = 9, d = 5;
  const at::Tensor x = Noise({n, d}, 15), y = Noise({m, d}, 16, 0.5);
  const auto k = [&](const at::Tensor& a, const at::Tensor& b) { return std::pow((a * b).sum().item<double>() / d + 1, 3); };
  const auto mmd = [&](int64_t skip_x, int64_t skip_y) {
    double xx = 0, yy = 0, xy = 0, nx = 0, ny = 0, nc = 0;
    for (int64_t i = 0; i < n; ++i) {
      for (int64_t j = 0; j < n; ++j) {
        if (i != j && i != skip_x && j != skip_x) xx += k(x[i], x[j]), ++nx;
      }
      for (int64_t j = 0; j < m; ++j) {
        if (i != skip_x && j != skip_y) xy += k(x[i], y[j]), ++nc;
      }
    }
    for (int64_t i = 0; i < m; ++i) {
      for (int64_t j = 0; j < m; ++j) {
        if (i != j && i != skip_y && j != skip_y) yy += k(y[i], y[j]), ++ny;
      }
    }
    return xx / nx + yy / ny - 2 * xy / nc;
  };
  const auto jackknife = [&](int64_t count, const std::function<double(int64_t)>& value) {
    double mean = 0, sum = 0;
    for (int64_t i = 0; i < count; ++i) mean += value(i) / count;
    for (int64_t i = 0; i < count; ++i) sum += std::pow(value(i) - mean, 2);
    return sum * (count - 1) / count;
  };
  const KernelDistance kid = KernelInceptionDistance(x, y);
  EXPECT_NEAR(kid.value, mmd(-1, -1), 1e-12);
  const double variance =
      jackknife(n, [&](int64_t i) { return mmd(i, -1); }) + jackknife(m, [&](int64_t i) { return mmd(-1, i); });
  EXPECT_NEAR(kid.standard_error, std::sqrt(variance), 1e-12);
}

TEST(KernelDistance, IsUnbiasedAndItsErrorIsPredicted) {
  const int trials = 60;
  double mean = 0, square = 0, predicted = 0;
  for (int t = 0; t < trials; ++t) {
    const KernelDistance kid = KernelInceptionDistance(Noise({60, 8}, 100 + 2 * t), Noise({60, 8}, 101 + 2 * t, 0.6));
    mean += kid.value / trials, square += kid.value * kid.value / trials, predicted += kid.standard_error / trials;
  }
  const double spread = std::sqrt((square - mean * mean) * trials / (trials - 1));
  // E k(x, x') = 1 + 3 E[s^2] + 3 E[s] + E[s^3] with s = x.y / d, in closed form for N(m 1, I), d = 8, m = 0 and 0.6.
  const auto expected_kernel = [](double p, double q) {
    const double d = 8, mu = p * q, var = 1 + p * p + q * q;  // of one product x_i y_i
    const double m1 = mu, m2 = mu * mu + var / d;
    const double central3 = 6 * mu;  // E[(xy - mu)^3] for independent unit-variance normals with means p, q
    const double m3 = mu * mu * mu + 3 * mu * var / d + central3 / (d * d);
    return 1 + 3 * m1 + 3 * m2 + m3;
  };
  const double truth = expected_kernel(0, 0) + expected_kernel(0.6, 0.6) - 2 * expected_kernel(0, 0.6);
  EXPECT_NEAR(mean, truth, 4 * spread / std::sqrt(trials));
  EXPECT_NEAR(predicted / spread, 1.0, 0.3);
}

}  // namespace
}  // namespace mvstudio::avatar
