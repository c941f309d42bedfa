#include "geometry/solve/block_cholesky.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "core/random.h"
#include "tests/support/test.h"

/// Held against Eigen's dense factor.
namespace mvstudio::geometry {
namespace {

struct Pattern {
  std::vector<int> widths;
  std::vector<std::vector<int>> groups;
  std::vector<std::pair<int, int>> couplings;
};

/// A chain of positions, each coupled with the next two, and two lengths that all are coupled with; groups out of order.
Pattern Chain(int count) {
  Pattern pattern;
  for (int i = 0; i < count; ++i) {
    pattern.widths.push_back(3);
    for (int k = 1; k <= 2 && i + k < count; ++k) pattern.couplings.emplace_back(i + k, i);
    pattern.couplings.emplace_back(i, count), pattern.couplings.emplace_back(count + 1, i);
  }
  pattern.widths.insert(pattern.widths.end(), {1, 1});
  for (int i = 0; i < count; i += 5) pattern.groups.push_back({i});
  for (int i = 0; i < count; ++i) {
    if (i % 5) pattern.groups.emplace_back(std::vector<int>{i});
  }
  pattern.groups.emplace_back();
  pattern.groups.push_back({count + 1, count});
  return pattern;
}

/// Blocks that are symmetric, so that it does not matter which node comes first.
Eigen::MatrixXd Fill(const Pattern& pattern, BlockCholesky* matrix, double shift) {
  Rng rng(3);
  std::vector<Eigen::Index> first{0};
  for (const int width : pattern.widths) first.push_back(first.back() + width);
  Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(first.back(), first.back());
  matrix->SetZero();
  const auto set = [&](int a, int b, double value) {
    const auto place = matrix->Find(a, b);
    const int n = std::min(pattern.widths[static_cast<size_t>(a)], pattern.widths[static_cast<size_t>(b)]);
    for (int k = 0; k < n; ++k) {
      matrix->At(place)[k * (place.stride + 1)] += value;
      dense(first[static_cast<size_t>(a)] + k, first[static_cast<size_t>(b)] + k) += value;
      if (a != b) dense(first[static_cast<size_t>(b)] + k, first[static_cast<size_t>(a)] + k) += value;
    }
  };
  for (size_t i = 0; i < pattern.widths.size(); ++i) set(static_cast<int>(i), static_cast<int>(i), shift);
  for (const auto& [a, b] : pattern.couplings) set(a, b, rng.Uniform(-1, 1));
  return dense;
}

TEST(BlockCholesky, EqualsTheDenseFactor) {
  const Pattern pattern = Chain(23);
  BlockCholesky matrix(pattern.widths, pattern.groups, pattern.couplings);
  const Eigen::MatrixXd dense = Fill(pattern, &matrix, 12);
  ASSERT_TRUE(matrix.Factor());
  const Eigen::VectorXd right = Eigen::VectorXd::LinSpaced(dense.rows(), -1, 2);
  EXPECT_LT((matrix.Solve(right) - dense.ldlt().solve(right)).norm(), 1e-13);
  const Eigen::MatrixXd inverse = dense.inverse();
  const std::vector<Eigen::Matrix3d> blocks = matrix.InverseDiagonal();
  Eigen::Index row = 0;
  for (size_t i = 0; i < blocks.size(); ++i) {
    const int n = pattern.widths[i];
    EXPECT_LT((blocks[i].topLeftCorner(n, n) - inverse.block(row, row, n, n)).norm(), 1e-13) << i;
    row += n;
  }
}

TEST(BlockCholesky, SaysWhenNotPositiveDefinite) {
  const Pattern pattern = Chain(6);
  BlockCholesky matrix(pattern.widths, pattern.groups, pattern.couplings);
  Fill(pattern, &matrix, 0.1);
  EXPECT_FALSE(matrix.Factor());
  Fill(pattern, &matrix, std::nan(""));
  EXPECT_FALSE(matrix.Factor());
}

}  // namespace
}  // namespace mvstudio::geometry
