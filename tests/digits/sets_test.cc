// Digits of distances between sets of features.
#include <ATen/ATen.h>

#include <Eigen/SVD>
#include <cmath>
#include <limits>

#include "avatar/scores/nuclear_norm.h"
#include "avatar/scores/set_distance.h"
#include "core/error.h"
#include "core/format.h"
#include "core/random.h"
#include "tests/support/digits.h"
#include "tests/support/mp.h"
#include "tests/support/test.h"

namespace mvstudio::avatar {
namespace {

using MpMatrix = Eigen::Matrix<Mp, Eigen::Dynamic, Eigen::Dynamic>;
using MpRow = Eigen::Matrix<Mp, 1, Eigen::Dynamic>;

const char* const kMpfr = "definition in MPFR, 120 digits";
const char* const kClosed = "closed form";

DigitsCase Case(const std::string& what, const std::string& conditions, const std::string& oracle) {
  return {"Scores and sums", what, conditions, oracle};
}

at::Tensor Normals(at::IntArrayRef sizes, uint64_t seed) {
  Rng rng(seed);
  at::Tensor x = at::empty(sizes, at::kDouble);
  for (int64_t i = 0; i < x.numel(); ++i) x.data_ptr<double>()[i] = rng.Normal();
  return x;
}

/// (n, d) of rank `rank`.
at::Tensor Features(int64_t n, int64_t d, int64_t rank, uint64_t seed) {
  return Normals({n, rank}, seed).matmul(Normals({rank, d}, seed + 1)) / std::sqrt(static_cast<double>(rank)) + 0.2;
}

/// Centred samples over the root of n - 1, and their mean.
MpMatrix Centred(const at::Tensor& x, MpRow* mean) {
  const at::Tensor rows = x.contiguous();
  MpMatrix m(rows.size(0), rows.size(1));
  for (Eigen::Index i = 0; i < m.size(); ++i) m(i / m.cols(), i % m.cols()) = rows.data_ptr<double>()[i];
  *mean = m.colwise().sum() / Mp(m.rows());
  m.rowwise() -= *mean;
  return m / sqrt(Mp(m.rows() - 1));
}

/// Fréchet distance: the singular values of X~ Y~^T are the roots of the eigenvalues of S1 S2.
Mp Exact(const at::Tensor& x, const at::Tensor& y) {
  MpRow mean_x, mean_y;
  const MpMatrix a = Centred(x, &mean_x), b = Centred(y, &mean_y), m = a * b.transpose();
  const Mp cross = Eigen::JacobiSVD<MpMatrix>(m).singularValues().sum();
  return (mean_x - mean_y).squaredNorm() + a.squaredNorm() + b.squaredNorm() - 2 * cross;
}

void Record(const std::string& conditions, const at::Tensor& x, const at::Tensor& y, int expected) {
  RecordDigits(Case("Fréchet distance", conditions, kMpfr), expected,
               static_cast<double>(Mp(FrechetDistance(x, y)) / Exact(x, y) - 1));
}

TEST(SetDigits, FrechetOfAnyRank) {
  Record("n = 12 and 14, d = 40", Features(12, 40, 40, 1), 1.1 * Features(14, 40, 40, 5) + 0.1, 12);
  Record("n = 20 and 25, d = 10, rank 4", Features(20, 10, 4, 1), 1.1 * Features(25, 10, 4, 5) + 0.1, 12);
  Record("n = 2 and 2, d = 30", Features(2, 30, 30, 1), Features(2, 30, 30, 5), 12);
  for (const double unit : {1e-100, 1e100}) {
    Record(Format("n = 12 and 14, d = 20, features of %g", unit), unit * Features(12, 20, 20, 1),
           unit * 1.1 * Features(14, 20, 20, 5), 12);
  }
}

/// What is left of sums of traces, each rounded: the distance of sets that differ by `change` is about its square.
TEST(SetDigits, FrechetOfNearlyEqualSets) {
  const at::Tensor x = Features(12, 20, 20, 11);
  for (const double change : {1e-1, 1e-3, 1e-5}) {
    Record(Format("n = 12, d = 20, sets %g apart", change), x, x + change * Normals(x.sizes(), 12),
           testing::DigitsOf(1e-13 / (change * change)));
  }
}

/// Means far from zero: features are rounded to 1e-16 of them before anything is computed, and the oracle reads these numbers.
TEST(SetDigits, FrechetFarFromZero) {
  for (const double far : {1e3, 1e6, 1e9}) {
    Record(Format("n = 12 and 14, d = 20, features about %g", far), Features(12, 20, 20, 1) + far,
           1.1 * Features(14, 20, 20, 5) + far, testing::DigitsOf(1e-15 * far));
  }
}

/// One dimension, half of the samples at m - s, half at m + s: (m1 - m2)^2 + (s1 - s2)^2 n / (n - 1).
TEST(SetDigits, FrechetOfManySamples) {
  const auto set = [](int64_t n, double mean, double deviation) {
    at::Tensor x = at::empty({n, 1}, at::kDouble);
    for (int64_t i = 0; i < n; ++i) x.data_ptr<double>()[i] = mean + (i % 2 ? deviation : -deviation);
    return x;
  };
  for (const int64_t n : {int64_t{2}, int64_t{1000}, int64_t{10'000'000}}) {
    const double expected = 0.25 + 0.5625 * static_cast<double>(n) / static_cast<double>(n - 1);
    RecordDigits(Case("Fréchet distance", Format("n = %g, d = 1", static_cast<double>(n)), kClosed), 12,
                 FrechetDistance(set(n, 0.5, 1), set(n, 1, 0.25)) / expected - 1);
  }
}

TEST(SetDigits, NuclearNorms) {
  for (const double least : {1.0, 1e-9, 1e-300}) {
    const at::Tensor q = std::get<0>(at::linalg_qr(Normals({40, 40}, 3))),
                     values = at::logspace(0, std::log10(least), 40, 10, at::kDouble);
    RecordDigits(Case("sum of singular values", Format("40x40, values from 1 to %g", least), kClosed), 13,
                 NuclearNorm(q.matmul(at::diag(values))) / values.sum().item<double>() - 1);
  }
}

TEST(SetDigits, WhatHasNoDistance) {
  const auto refusal = [](const at::Tensor& x) {
    try {
      return Format("%g", FrechetDistance(x, x));
    } catch (const ContractViolation&) {
      return std::string("refused");
    }
  };
  for (const double bad : {std::nan(""), std::numeric_limits<double>::infinity()}) {
    at::Tensor x = Features(5, 3, 3, 1);
    x[2][1] = bad;
    RecordStatus(Case("Fréchet distance", Format("a feature is %g", bad), "definition"), "refused", refusal(x));
  }
  RecordStatus(Case("Fréchet distance", "n = 1", "definition"), "refused", refusal(Features(1, 3, 3, 1)));
}

}  // namespace
}  // namespace mvstudio::avatar
