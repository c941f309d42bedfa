#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <cmath>

#include "core/format.h"
#include "core/random.h"
#include "geometry/solve/block_cholesky.h"
#include "tests/digits/exact_squares.h"
#include "tests/support/digits.h"
#include "tests/support/test.h"

/// Digits of the equations that refine a take: a chain in time, and lengths that all its positions share.
namespace mvstudio::geometry {
namespace {

constexpr int kPositions = 20, kLengths = 2, kRows = 3 * kPositions + kLengths;

DigitsCase Case(const std::string& what, const std::string& conditions,
                const std::string& oracle = "dense factor in MPFR, 120 digits") {
  return {"Poses and adjustments", what, conditions, oracle};
}

/// Random couplings of neighbours in time, and of all with the lengths, on a diagonal of zeros.
Eigen::MatrixXd Couplings() {
  Rng rng(3);
  Eigen::MatrixXd m = Eigen::MatrixXd::Zero(kRows, kRows);
  for (int i = 0; i < kPositions; ++i) {
    for (int k = 3 * i; k < 3 * i + 3; ++k) {
      for (int j = 0; j < k; ++j) {
        if (j / 3 >= i - 2) m(k, j) = rng.Uniform(-1, 1);
      }
      for (int length = 0; length < kLengths; ++length) m(3 * kPositions + length, k) = rng.Uniform(-1, 1);
    }
  }
  return m.selfadjointView<Eigen::Lower>();
}

struct Blocks {
  std::vector<int> widths;
  std::vector<std::vector<int>> groups;
  std::vector<std::pair<int, int>> couplings;
};

Blocks BlocksOf() {
  Blocks blocks;
  for (int i = 0; i < kPositions; ++i) {
    blocks.widths.push_back(3);
    blocks.groups.push_back({i});
    for (int j = std::max(0, i - 2); j < i; ++j) blocks.couplings.emplace_back(i, j);
    for (int length = 0; length < kLengths; ++length) blocks.couplings.emplace_back(kPositions + length, i);
  }
  blocks.widths.insert(blocks.widths.end(), kLengths, 1);
  for (int a = 0; a < kLengths; ++a) {
    for (int b = 0; b < a; ++b) blocks.couplings.emplace_back(kPositions + a, kPositions + b);
  }
  blocks.groups.emplace_back();
  for (int length = 0; length < kLengths; ++length) blocks.groups.back().push_back(kPositions + length);
  return blocks;
}

/// Each block with the rows of the node that is eliminated later: here the one of the larger number.
BlockCholesky Filled(const Eigen::MatrixXd& dense) {
  const Blocks blocks = BlocksOf();
  BlockCholesky matrix(blocks.widths, blocks.groups, blocks.couplings);
  matrix.SetZero();
  const auto first = [](int node) { return node < kPositions ? 3 * node : 2 * kPositions + node; };
  const auto fill = [&](int a, int b) {
    const BlockCholesky::Place place = matrix.Find(a, b);
    for (int row = 0; row < blocks.widths[static_cast<size_t>(a)]; ++row) {
      for (int col = 0; col < blocks.widths[static_cast<size_t>(b)]; ++col) {
        matrix.At(place)[col * place.stride + row] = dense(first(a) + row, first(b) + col);
      }
    }
  };
  for (int node = 0; node < kPositions + kLengths; ++node) fill(node, node);
  for (const auto& [a, b] : blocks.couplings) fill(a, b);
  return matrix;
}

TEST(FactorDigits, ChainsWithSharedLengths) {
  const Eigen::MatrixXd couplings = Couplings();
  const double least = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(couplings, Eigen::EigenvaluesOnly).eigenvalues()[0];
  for (const double margin : {1.0, 1e-4, 1e-8}) {
    const Eigen::MatrixXd dense = couplings + (margin - least) * Eigen::MatrixXd::Identity(kRows, kRows);
    BlockCholesky matrix = Filled(dense);
    ASSERT_TRUE(matrix.Factor()) << margin;
    const Eigen::VectorXd right = Eigen::VectorXd::LinSpaced(kRows, -1, 2);
    const MatrixXmp inverse = MatrixXmp(dense.cast<Mp>()).ldlt().solve(MatrixXmp(MatrixXmp::Identity(kRows, kRows)));
    const VectorXmp exact = inverse * right.cast<Mp>();
    const std::string where =
        Format("20 positions, 2 lengths, condition 1e%d", static_cast<int>(std::lround(std::log10(-2 * least / margin))));
    const int promised = testing::DigitsOf(1e-13 / margin);
    RecordDigits(Case("step of a refined take (`BlockCholesky`)", where), promised,
                 ((matrix.Solve(right).cast<Mp>() - exact).norm() / exact.norm()).convert_to<double>());
    WorstError worst;
    const std::vector<Eigen::Matrix3d> blocks = matrix.InverseDiagonal();
    for (int row = 0; row < kRows; ++row) {
      const bool is_length = row >= 3 * kPositions;
      const int node = is_length ? row - 2 * kPositions : row / 3, k = is_length ? 0 : row % 3;
      worst.Add((Mp(blocks[static_cast<size_t>(node)](k, k)) / inverse(row, row) - 1).convert_to<double>());
    }
    RecordDigits(Case("variances of a refined take (`BlockCholesky`)", where), promised, worst.value());
  }
}

TEST(FactorDigits, WhatHasNoFactor) {
  const auto factor = [](const Eigen::MatrixXd& dense) {
    BlockCholesky matrix = Filled(dense);
    return matrix.Factor() ? "factor" : "none";
  };
  const char* const definition = "definition";
  RecordStatus(Case("step of a refined take (`BlockCholesky`)", "zeros on the diagonal", definition), "none",
               factor(Couplings()));
  Eigen::MatrixXd bad = Couplings() + 100 * Eigen::MatrixXd::Identity(kRows, kRows);
  RecordStatus(Case("step of a refined take (`BlockCholesky`)", "a diagonal of 100", definition), "factor", factor(bad));
  bad(31, 31) = std::nan("");
  RecordStatus(Case("step of a refined take (`BlockCholesky`)", "a NaN", definition), "none", factor(bad));
}

}  // namespace
}  // namespace mvstudio::geometry
