#include "geometry/solve/selected_inverse.h"

#include <Eigen/LU>
#include <vector>

#include "core/random.h"
#include "tests/support/test.h"

namespace mvstudio::geometry {
namespace {

TEST(SelectedInverse, EqualsTheDenseInverse) {
  Rng rng(4);
  constexpr int kSize = 40;
  std::vector<Eigen::Triplet<double>> entries;
  Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(kSize, kSize);
  for (int i = 0; i < kSize; ++i) {
    for (int j = 0; j <= i; ++j) {
      const bool present = i == j || i - j == 3 || i == kSize - 1 || rng.Uniform() < 0.04;
      if (!present) continue;
      const double value = i == j ? 8 + rng.Uniform() : rng.Uniform(-1, 1) / (i == kSize - 1 ? 5 : 1);
      dense(i, j) = dense(j, i) = value;
      entries.emplace_back(i, j, value);
    }
  }
  Eigen::SparseMatrix<double> sparse(kSize, kSize);
  sparse.setFromTriplets(entries.begin(), entries.end());
  const SelectedInverse selected(sparse);
  ASSERT_TRUE(selected.ok());
  const Eigen::MatrixXd inverse = dense.inverse();
  for (const auto& entry : entries) {
    EXPECT_NEAR(selected(entry.row(), entry.col()), inverse(entry.row(), entry.col()), 1e-12);
    EXPECT_EQ(selected(entry.row(), entry.col()), selected(entry.col(), entry.row()));
  }
}

TEST(SelectedInverse, SaysWhenNotPositiveDefinite) {
  Eigen::SparseMatrix<double> matrix(2, 2);
  matrix.insert(0, 0) = 1, matrix.insert(1, 0) = 2, matrix.insert(1, 1) = 1;
  EXPECT_FALSE(SelectedInverse(matrix).ok());
}

}  // namespace
}  // namespace mvstudio::geometry
