#include "calib/bundle/schur_lm.h"

#include <Eigen/Dense>

#include "core/random.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

/// A dense problem beside its Schur form: unknowns are `globals` numbers, then blocks of `dim`.
struct Dense {
  Eigen::MatrixXd h;
  Eigen::VectorXd g;
  SchurSystem system;
};

/// Each block meets every second global number, and as many residuals as `residuals_of_block` says.
Dense MakeDense(int globals, int dim, const std::vector<int>& residuals_of_block) {
  Rng rng(5);
  const int blocks = static_cast<int>(residuals_of_block.size()), n = globals + dim * blocks;
  Dense dense{Eigen::MatrixXd::Zero(n, n), Eigen::VectorXd::Zero(n), {}};
  std::vector<std::vector<int>> columns(static_cast<size_t>(blocks));
  for (int b = 0; b < blocks; ++b)
    for (int k = b % 2; k < globals; k += 2) columns[static_cast<size_t>(b)].push_back(k);
  Allocate(globals, dim, columns, &dense.system);
  for (int b = 0; b < blocks; ++b) {
    for (int r = 0; r < residuals_of_block[static_cast<size_t>(b)]; ++r) {
      Eigen::VectorXd j = Eigen::VectorXd::Zero(n);
      for (const int k : columns[static_cast<size_t>(b)]) j[k] = rng.Normal();
      for (int k = 0; k < dim; ++k) j[globals + dim * b + k] = rng.Normal();
      const double residual = rng.Normal();
      dense.h += j * j.transpose(), dense.g += residual * j;
    }
    const Eigen::Index at = globals + dim * b;
    dense.system.block_h.middleCols(dim * b, dim) = dense.h.block(at, at, dim, dim);
    dense.system.block_g.col(b) = dense.g.segment(at, dim);
    for (Eigen::Index i = dense.system.begin[b]; i < dense.system.begin[b + 1]; ++i)
      dense.system.w.col(i) = dense.h.block(at, dense.system.columns[i], dim, 1);
  }
  dense.system.h = dense.h.topLeftCorner(globals, globals).triangularView<Eigen::Lower>();
  dense.system.g = dense.g.head(globals);
  return dense;
}

TEST(SchurLm, ReducesAsTheDenseMatrixDoes) {
  for (const int dim : {2, 3, 6}) {
    constexpr int kGlobals = 14;
    const Dense dense = MakeDense(kGlobals, dim, {9, 12, 8, 20, 11, 7});
    const Eigen::Index n = dense.h.rows(), rest = n - kGlobals;
    const Eigen::MatrixXd hbb = dense.h.bottomRightCorner(rest, rest), hab = dense.h.topRightCorner(kGlobals, rest);
    const Eigen::MatrixXd expected = dense.h.topLeftCorner(kGlobals, kGlobals) - hab * hbb.fullPivLu().solve(hab.transpose());
    const Eigen::VectorXd right = dense.g.head(kGlobals) - hab * hbb.fullPivLu().solve(dense.g.tail(rest));
    for (const int threads : {1, 2}) {
      const ReducedSystem reduced = Reduce(dense.system, 0, threads);
      const Eigen::MatrixXd found = reduced.h.selfadjointView<Eigen::Lower>();
      EXPECT_LT((found - expected).norm(), 1e-9 * expected.norm()) << dim;
      EXPECT_LT((reduced.g - right).norm(), 1e-9 * right.norm()) << dim;
    }
  }
}

/// A point that nothing sees, and one that a single residual sees: no numbers that are none.
TEST(SchurLm, BlocksThatAreNotDeterminedStayFinite) {
  const Dense dense = MakeDense(14, 3, {0, 1, 2, 12, 12, 12});
  const ReducedSystem reduced = Reduce(dense.system, 0, 1);
  EXPECT_TRUE(reduced.h.allFinite());
  EXPECT_TRUE(reduced.g.allFinite());
}

/// Half the line of its one global unknown has no residual: that below `from`.
struct HalfLine : SchurProblem {
  double from, x = 0, trial = 0;
  explicit HalfLine(double first) : from(first) {}
  void Try(const Eigen::VectorXd& global, const Eigen::MatrixXd&) override { trial = x + global[0]; }
  bool LinearizeTrial(SchurSystem* system) override {
    if (trial < from) return false;
    system->SetZero();
    system->cost = (trial - 2) * (trial - 2), system->h(0, 0) = 1, system->g[0] = trial - 2;
    return true;
  }
  void AcceptTrial() override { x = trial; }
};

TEST(SchurLm, AStartWithoutAResidualIsUndefined) {
  for (const double from : {1.0, -1.0}) {
    HalfLine problem(from);
    SchurSystem system;
    Allocate(1, 3, {}, &system);
    const SchurLmReport report = SolveSchurLm(&problem, &system, {});
    EXPECT_EQ(report.status, from > 0 ? Status::kUndefined : Status::kOk);
    EXPECT_NEAR(problem.x, from > 0 ? 0 : 2, 1e-6);
  }
}

}  // namespace
}  // namespace mvstudio::calib
