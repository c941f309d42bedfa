#include "avatar/scores/nuclear_norm.h"

#include <ATen/ATen.h>
#include <ATen/Parallel.h>

#include <cmath>

#include "core/error.h"
#include "core/random.h"
#include "tests/support/test.h"

/// The oracle is LAPACK's singular values, or matrices whose singular values are known.
namespace mvstudio::avatar {
namespace {

at::Tensor Noise(int64_t rows, int64_t columns, uint64_t seed) {
  Rng rng(seed);
  at::Tensor m = at::empty({rows, columns}, at::kDouble);
  for (int64_t i = 0; i < m.numel(); ++i) m.data_ptr<double>()[i] = rng.Normal();
  return m;
}

at::Tensor Orthogonal(int64_t n, uint64_t seed) { return std::get<0>(at::linalg_qr(Noise(n, n, seed))); }

/// Relative to the sum.
double ErrorOf(const at::Tensor& m) {
  const double truth = at::linalg_svdvals(m).sum().item<double>();
  return NuclearNorm(m) / truth - 1;
}

TEST(NuclearNorm, OfEveryShapeAroundTheBlocks) {
  const int64_t sizes[] = {1, 2, 3, 7, 8, 9, 16, 17, 31, 32, 33, 64, 100, 257, 300};
  for (const int64_t rows : sizes) {
    for (const int64_t columns : sizes) EXPECT_NEAR(ErrorOf(Noise(rows, columns, 1)), 0, 3e-14) << rows << " x " << columns;
  }
}

TEST(NuclearNorm, OfMatricesWithoutFullRank) {
  for (const int64_t rank : {1, 2, 17, 60}) {
    EXPECT_NEAR(ErrorOf(Noise(80, rank, 2).matmul(Noise(rank, 70, 3))), 0, 1e-13) << rank;
  }
  EXPECT_EQ(NuclearNorm(at::zeros({40, 30}, at::kDouble)), 0);
  EXPECT_NEAR(NuclearNorm(at::ones({40, 30}, at::kDouble)), std::sqrt(1200.0), 1e-12);
  at::Tensor one = at::zeros({40, 30}, at::kDouble);
  one[39][29] = -3;
  EXPECT_DOUBLE_EQ(NuclearNorm(one), 3);
  EXPECT_NEAR(NuclearNorm(at::eye(70, at::kDouble)), 70, 1e-12);
}

TEST(NuclearNorm, OfValuesOverManyDecades) {
  const int64_t n = 90;
  const at::Tensor values = at::pow(10.0, at::linspace(0, -18, n, at::kDouble));
  const at::Tensor m = (Orthogonal(n, 4) * values).matmul(Orthogonal(n, 5));
  EXPECT_NEAR(NuclearNorm(m) / values.sum().item<double>(), 1, 1e-14);
  for (const double scale : {1e-300, 1e-160, 1e160, 1e300})
    EXPECT_NEAR(NuclearNorm(m * scale) / scale / NuclearNorm(m), 1, 1e-14) << scale;
}

TEST(NuclearNorm, RefusesWhatIsNotFinite) {
  for (const double bad : {std::nan(""), HUGE_VAL}) {
    at::Tensor m = Noise(5, 4, 9);
    m[3][2] = bad;
    EXPECT_THROW(NuclearNorm(m), ContractViolation);
  }
}

TEST(NuclearNorm, IsThatOfTheTransposed) {
  const at::Tensor m = Noise(50, 33, 6);
  EXPECT_NEAR(NuclearNorm(m), NuclearNorm(m.t()), 1e-12);
  EXPECT_NEAR(NuclearNorm(m), NuclearNorm(m.flip(0)), 1e-12);
}

TEST(NuclearNorm, IsTheSameOnAnyNumberOfThreads) {
  const at::Tensor m = Noise(300, 520, 7);
  const int threads = at::get_num_threads();
  at::set_num_threads(1);
  const double one = NuclearNorm(m);
  at::set_num_threads(2);
  EXPECT_NEAR(NuclearNorm(m) / one, 1, 1e-15);
  at::set_num_threads(threads);
}

TEST(Bidiagonalise, KeepsTheSizeAndTheSingularValues) {
  const at::Tensor m = Noise(60, 45, 8);
  const Bidiagonal b = Bidiagonalise(m);
  ASSERT_EQ(b.diagonal.size(), 45u);
  ASSERT_EQ(b.above.size(), 44u);
  at::Tensor dense = at::zeros({45, 45}, at::kDouble);
  for (int64_t i = 0; i < 45; ++i) dense[i][i] = b.diagonal[i];
  for (int64_t i = 0; i < 44; ++i) dense[i][i + 1] = b.above[i];
  EXPECT_TRUE(at::allclose(at::linalg_svdvals(dense), at::linalg_svdvals(m), 1e-13, 1e-13));
  EXPECT_THROW(Bidiagonalise(m.t()), ContractViolation);
}

// Ones on both diagonals: 2 cos(k pi / (2 n + 1)), k = 1 ... n.
TEST(SumOfSingularValues, ClosedForm) {
  for (const int64_t n : {1, 2, 3, 10, 500}) {
    const Bidiagonal b{std::vector<double>(n, 1), std::vector<double>(n - 1, 1)};
    double truth = 0;
    for (int64_t k = 1; k <= n; ++k) truth += 2 * std::cos(k * M_PI / (2.0 * n + 1));
    EXPECT_NEAR(SumOfSingularValues(b) / truth, 1, 1e-14) << n;
  }
}

TEST(SumOfSingularValues, OfGradedAndSingularOnesBothWaysRound) {
  const int64_t n = 200;
  for (const bool up : {false, true}) {
    for (const bool singular : {false, true}) {
      Bidiagonal b{std::vector<double>(n), std::vector<double>(n - 1)};
      at::Tensor dense = at::zeros({n, n}, at::kDouble);
      for (int64_t i = 0; i < n; ++i) b.diagonal[i] = singular && i % 50 == 20 ? 0 : std::pow(10, -0.1 * (up ? n - i : i));
      for (int64_t i = 0; i + 1 < n; ++i) b.above[i] = 0.7 * std::pow(10, -0.1 * (up ? n - i : i));
      for (int64_t i = 0; i < n; ++i) dense[i][i] = b.diagonal[i];
      for (int64_t i = 0; i + 1 < n; ++i) dense[i][i + 1] = b.above[i];
      const double truth = at::linalg_svdvals(dense).sum().item<double>();
      EXPECT_NEAR(SumOfSingularValues(b) / truth, 1, 1e-14) << up << singular;
    }
  }
}

}  // namespace
}  // namespace mvstudio::avatar
