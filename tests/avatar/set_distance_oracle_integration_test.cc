// The Fréchet distance against 200 bits and against closed forms, on covariances of full and of low rank.
#include <ATen/ATen.h>

#include <Eigen/Core>
#include <cmath>
#include <tuple>
#include <vector>

#include "avatar/scores/set_distance.h"
#include "core/random.h"
#include "tests/support/mp.h"
#include "tests/support/test.h"

namespace mvstudio::avatar {
namespace {

using MpMatrix = Eigen::Matrix<Mp, Eigen::Dynamic, Eigen::Dynamic>;
using MpRow = Eigen::Matrix<Mp, 1, Eigen::Dynamic>;

at::Tensor Noise(at::IntArrayRef sizes, uint64_t seed) {
  Rng rng(seed);
  at::Tensor x = at::empty(sizes, at::kDouble);
  double* p = x.data_ptr<double>();
  for (int64_t i = 0; i < x.numel(); ++i) p[i] = rng.Normal();
  return x;
}

/// (n, d) of rank `rank`, cut at zero as features after a ReLU are when `relu` (which raises the rank).
at::Tensor LowRank(int64_t n, int64_t d, int64_t rank, bool relu, uint64_t seed) {
  const at::Tensor x = Noise({n, rank}, seed).matmul(Noise({rank, d}, seed + 1)) / std::sqrt(static_cast<double>(rank)) + 0.2;
  return relu ? x.relu() : x;
}

MpMatrix ToMp(const at::Tensor& x) {
  const at::Tensor y = x.contiguous();
  const double* p = y.data_ptr<double>();
  MpMatrix m(y.size(0), y.size(1));
  for (int64_t i = 0; i < m.rows(); ++i) {
    for (int64_t j = 0; j < m.cols(); ++j) m(i, j) = p[i * m.cols() + j];
  }
  return m;
}

/// Eigenvalues of a symmetric matrix by Jacobi's rotations (Golub and Van Loan, "Matrix Computations", 8.5).
std::vector<Mp> Eigenvalues(MpMatrix s) {
  const Mp enough = s.squaredNorm() * Mp("1e-110");
  Mp off = 1;
  for (int sweep = 0; sweep < 60 && off > enough; ++sweep) {
    off = 0;
    for (int64_t p = 0; p < s.rows(); ++p) {
      for (int64_t q = p + 1; q < s.rows(); ++q) {
        if (s(p, q) == 0) continue;
        off += s(p, q) * s(p, q);
        const Mp tau = (s(q, q) - s(p, p)) / (2 * s(p, q));
        const Mp t = (tau >= 0 ? 1 : -1) / (abs(tau) + sqrt(1 + tau * tau)), c = 1 / sqrt(1 + t * t), sn = t * c;
        const MpMatrix rp = s.row(p), rq = s.row(q);
        s.row(p) = c * rp - sn * rq, s.row(q) = sn * rp + c * rq;
        const MpMatrix cp = s.col(p), cq = s.col(q);
        s.col(p) = c * cp - sn * cq, s.col(q) = sn * cp + c * cq;
      }
    }
  }
  EXPECT_LE(off, enough);
  std::vector<Mp> values;
  for (int64_t i = 0; i < s.rows(); ++i) values.push_back(s(i, i));
  return values;
}

/// By the definition with 60 digits: the roots of the eigenvalues of M M^T, M = X~ Y~^T, are those of S1 S2.
double Reference(const at::Tensor& x, const at::Tensor& y) {
  const auto centred = [](const at::Tensor& t, MpRow* mean) {
    MpMatrix m = ToMp(t);
    *mean = m.colwise().sum() / Mp(m.rows());
    m.rowwise() -= *mean;
    return MpMatrix(m / sqrt(Mp(m.rows() - 1)));
  };
  MpRow mean_x, mean_y;
  const MpMatrix a = centred(x, &mean_x), b = centred(y, &mean_y), m = a * b.transpose();
  const MpMatrix gram = m.rows() <= m.cols() ? MpMatrix(m * m.transpose()) : MpMatrix(m.transpose() * m);
  Mp cross = 0;
  for (const Mp& value : Eigenvalues(gram)) {
    if (value > 0) cross += sqrt(value);
  }
  const Mp distance = (mean_x - mean_y).squaredNorm() + a.squaredNorm() + b.squaredNorm() - 2 * cross;
  return static_cast<double>(distance);
}

struct Case {
  int64_t n_x, n_y, d, rank;
  bool relu;
};

TEST(FrechetOracle, AgreesWith200BitsOnRankDeficientData) {
  const Case cases[] = {
      {20, 20, 2048, 2048, true},                          // fewer samples than dimensions
      {30, 17, 512, 512, true},   {40, 50, 64, 5, false},  // rank 5 in both
      {40, 50, 64, 5, true},      {80, 70, 12, 3, false},  // more samples than dimensions, singular all the same
      {60, 61, 24, 24, true}};
  for (const Case& c : cases) {
    const at::Tensor x = LowRank(c.n_x, c.d, c.rank, c.relu, 1), y = 1.1 * LowRank(c.n_y, c.d, c.rank, c.relu, 5) + 0.1;
    const double expected = Reference(x, y);
    EXPECT_GT(expected, 0);
    EXPECT_NEAR(FrechetDistance(x, y) / expected, 1, 1e-13) << c.n_x << " " << c.d << " " << c.rank << " " << c.relu;
    EXPECT_NEAR(FrechetDistance(y, x) / expected, 1, 1e-13);
  }
}

TEST(FrechetOracle, AgreesWith200BitsAlsoWhenTheSetsAreNearlyEqual) {
  const at::Tensor x = LowRank(25, 256, 256, true, 11), trace = (x - x.mean(0)).square().sum() / 24;
  for (const double change : {1e-1, 1e-3, 1e-6}) {
    const at::Tensor y = x + change * Noise(x.sizes(), 12);
    EXPECT_NEAR(FrechetDistance(x, y), Reference(x, y), 1e-14 * trace.item<double>()) << change;
  }
}

/// Orthonormal columns.
at::Tensor Basis(int64_t d, int64_t k, uint64_t seed) { return std::get<0>(at::linalg_qr(Noise({d, k}, seed))); }

/// n samples whose mean is 0 and whose covariance is the identity of k < n dimensions, to rounding.
at::Tensor Whitened(int64_t n, int64_t k, uint64_t seed) {
  at::Tensor x = Noise({n, k}, seed);
  x = x - x.mean(0);
  return std::get<0>(at::linalg_qr(x)) * std::sqrt(static_cast<double>(n - 1));
}

TEST(FrechetOracle, ClosedFormForCommutingGaussiansOfAnyRank) {
  for (const auto& [n, d, k] : {std::tuple<int64_t, int64_t, int64_t>{60, 40, 40}, {60, 40, 9}, {30, 300, 20}}) {
    const at::Tensor basis = Basis(d, k, 21), shift = Noise({d}, 22);
    at::Tensor s1 = at::linspace(2, 0.01, k, at::kDouble), s2 = at::linspace(0, 3, k, at::kDouble);
    s1[k / 2] = 0;  // a direction in which one of them has no extent
    const at::Tensor x = (Whitened(n, k, 23) * s1).matmul(basis.t()),
                     y = (Whitened(n + 7, k, 24) * s2).matmul(basis.t()) + shift;
    const double expected = shift.square().sum().item<double>() + (s1 - s2).square().sum().item<double>();
    EXPECT_NEAR(FrechetDistance(x, y) / expected, 1, 1e-13) << n << " " << d << " " << k;
  }
}

TEST(FrechetOracle, SelfDistanceIsNothingAndNoDistanceIsNegative) {
  for (const int64_t n : {4, 50, 200}) {
    for (const int64_t d : {3, 64, 512}) {
      const at::Tensor x = LowRank(n, d, std::min<int64_t>(d, 20), true, 31) + 3;
      const double trace = (x - x.mean(0)).square().sum().item<double>() / static_cast<double>(n - 1);
      EXPECT_LE(FrechetDistance(x, x), 1e-12 * trace) << n << " " << d;
      for (const double change : {0.0, 1e-15, 1e-12, 1e-9}) {
        const double distance = FrechetDistance(x, x * (1 + change));
        EXPECT_GE(distance, 0) << n << " " << d << " " << change;
        EXPECT_LE(distance, 1e-12 * trace + 1e-6 * change * x.square().sum().item<double>()) << n << " " << d << " " << change;
      }
    }
  }
}

}  // namespace
}  // namespace mvstudio::avatar
