#include "calib/bundle/schur_lm.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "core/check.h"
#include "core/parallel.h"

namespace mvstudio::calib {
namespace {

using Eigen::Index;

constexpr int kMaxChunks = 4;  // partial sums, added in order, so that the number of threads does not matter
constexpr double kMinDamping = 1e-15, kMaxDamping = 1e12;
constexpr double kBlockFloor = 1e-14;  // rounding may leave a block that its residuals do not determine slightly indefinite

/// h + damping diag(h); an unknown that no residual meets keeps its value.
void Damp(double damping, Eigen::Ref<Eigen::MatrixXd> h) {
  for (Index i = 0; i < h.rows(); ++i) h(i, i) = h(i, i) > 0 ? h(i, i) * (1 + damping) : 1;
}

/// Cholesky factor of one damped block.
Eigen::LLT<Eigen::MatrixXd> FactorBlock(const SchurSystem& system, int block, double damping) {
  const int e = system.block_dim();
  Eigen::MatrixXd h = system.block_h.middleCols(static_cast<Index>(block) * e, e);
  Damp(std::max(damping, kBlockFloor), h);
  return Eigen::LLT<Eigen::MatrixXd>(h);
}

void SubtractBlock(const SchurSystem& system, int block, double damping, ReducedSystem* reduced) {
  const Index begin = system.begin[block], m = system.begin[block + 1] - begin;
  if (m == 0) return;
  const auto factor = FactorBlock(system, block, damping);
  if (factor.info() != Eigen::Success) return;  // no residuals
  const Eigen::MatrixXd y = factor.matrixL().solve(system.w.middleCols(begin, m));
  const Eigen::VectorXd z = factor.matrixL().solve(system.block_g.col(block));
  Eigen::MatrixXd product = Eigen::MatrixXd::Zero(m, m);
  product.selfadjointView<Eigen::Lower>().rankUpdate(y.transpose());
  const Eigen::VectorXd right = y.transpose() * z;
  const int* columns = system.columns.data() + begin;
  for (Index j = 0; j < m; ++j) {
    double* target = reduced->h.data() + columns[j] * reduced->h.rows();
    for (Index i = j; i < m; ++i) target[columns[i]] -= product(i, j);
    reduced->g[columns[j]] -= right[j];
  }
}

/// The same for blocks of three, points: no call is worth its cost for products this thin.
void SubtractPoints(const SchurSystem& system, int first, int last, double damping, ReducedSystem* reduced) {
  Eigen::Matrix3Xd y;
  for (int block = first; block < last; ++block) {
    const Index begin = system.begin[block], m = system.begin[block + 1] - begin;
    if (m == 0) continue;
    Eigen::Matrix3d h = system.block_h.middleCols<3>(3 * static_cast<Index>(block));
    Damp(std::max(damping, kBlockFloor), h);
    const Eigen::LLT<Eigen::Matrix3d> factor(h);
    if (factor.info() != Eigen::Success) continue;  // no residuals
    y = system.w.middleCols(begin, m);
    factor.matrixL().solveInPlace(y);
    const Eigen::Vector3d z = factor.matrixL().solve(Eigen::Vector3d(system.block_g.col(block)));
    const int* columns = system.columns.data() + begin;
    for (Index j = 0; j < m; ++j) {
      double* target = reduced->h.data() + columns[j] * reduced->h.rows();
      const Eigen::Vector3d left = y.col(j);
      for (Index i = j; i < m; ++i) target[columns[i]] -= y.col(i).dot(left);
      reduced->g[columns[j]] -= left.dot(z);
    }
  }
}

/// Steps of all blocks for a step of the global unknowns.
Eigen::MatrixXd BackSubstitute(const SchurSystem& system, const Eigen::VectorXd& global, double damping, int num_threads) {
  Eigen::MatrixXd steps = Eigen::MatrixXd::Zero(system.block_dim(), system.num_blocks());
  ParallelFor(system.num_blocks(), num_threads, [&](int64_t block) {
    const auto factor = FactorBlock(system, static_cast<int>(block), damping);
    if (factor.info() != Eigen::Success) return;
    Eigen::VectorXd right = -system.block_g.col(block);
    for (Index i = system.begin[block]; i < system.begin[block + 1]; ++i) right -= system.w.col(i) * global[system.columns[i]];
    steps.col(block) = factor.solve(right);
  });
  return steps;
}

struct Step {
  bool ok = false;
  Eigen::VectorXd global;
  Eigen::MatrixXd blocks;
  double predicted = 0;  ///< decrease of the cost
};

Step SolveStep(const SchurSystem& system, double damping, int num_threads) {
  Step step;
  ReducedSystem reduced = Reduce(system, damping, num_threads);
  const Eigen::VectorXd diagonal = system.h.diagonal();
  for (Index i = 0; i < diagonal.size(); ++i) reduced.h(i, i) += diagonal[i] > 0 ? damping * diagonal[i] : 1;
  const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> factor(reduced.h);
  if (factor.info() != Eigen::Success) return step;
  step.global = factor.solve(-reduced.g);
  step.blocks = BackSubstitute(system, step.global, damping, num_threads);
  step.ok = step.global.allFinite() && step.blocks.allFinite();
  // With (H + damping D) d = -g: decrease = -2 g.d - d.H d = -g.d + damping d.D d.
  double decrease = -system.g.dot(step.global) + damping * step.global.cwiseAbs2().dot(diagonal);
  const int e = system.block_dim();
  for (int b = 0; b < system.num_blocks(); ++b) {
    const auto h = system.block_h.middleCols(static_cast<Index>(b) * e, e);
    decrease += -system.block_g.col(b).dot(step.blocks.col(b)) + damping * step.blocks.col(b).cwiseAbs2().dot(h.diagonal());
  }
  step.predicted = decrease;
  return step;
}

}  // namespace

void SchurSystem::SetZero() {
  cost = 0;
  h.setZero(), g.setZero(), block_h.setZero(), block_g.setZero(), w.setZero();
}

void Allocate(int num_global, int block_dim, const std::vector<std::vector<int>>& columns_of_block, SchurSystem* system) {
  const Index blocks = static_cast<Index>(columns_of_block.size());
  system->columns.clear();
  system->begin = {0};
  for (const std::vector<int>& columns : columns_of_block) {
    MVS_CHECK(std::is_sorted(columns.begin(), columns.end()), "columns of a block are not in ascending order");
    system->columns.insert(system->columns.end(), columns.begin(), columns.end());
    system->begin.push_back(static_cast<Index>(system->columns.size()));
  }
  system->h.setZero(num_global, num_global);
  system->g.setZero(num_global);
  system->block_h.setZero(block_dim, block_dim * blocks);
  system->block_g.setZero(block_dim, blocks);
  system->w.setZero(block_dim, static_cast<Index>(system->columns.size()));
}

ReducedSystem Reduce(const SchurSystem& system, double damping, int num_threads) {
  const int blocks = system.num_blocks(), chunks = std::max(1, std::min(kMaxChunks, blocks));
  std::vector<ReducedSystem> partial(chunks);
  ParallelFor(chunks, num_threads, [&](int64_t chunk) {
    ReducedSystem& sum = partial[chunk];
    sum.h.setZero(system.h.rows(), system.h.cols());
    sum.g.setZero(system.g.size());
    const int first = static_cast<int>(chunk * blocks / chunks), last = static_cast<int>((chunk + 1) * blocks / chunks);
    if (system.block_dim() == 3) SubtractPoints(system, first, last, damping, &sum);
    for (int block = first; block < last && system.block_dim() != 3; ++block) SubtractBlock(system, block, damping, &sum);
  });
  ReducedSystem reduced{system.h, system.g};
  for (const ReducedSystem& sum : partial) reduced.h += sum.h, reduced.g += sum.g;
  return reduced;
}

SchurLmReport SolveSchurLm(SchurProblem* problem, SchurSystem* system, const SchurLmOptions& options) {
  SchurLmReport report;
  problem->Try(Eigen::VectorXd::Zero(system->g.size()), Eigen::MatrixXd::Zero(system->block_dim(), system->num_blocks()));
  report.num_iterations = 1;
  if (!problem->LinearizeTrial(system)) return {Status::kUndefined, 0, 1};
  problem->AcceptTrial();
  SchurSystem trial = *system;
  double damping = options.first_damping, growth = 2;
  report.status = Status::kNotConverged;
  while (report.num_iterations < options.max_iterations && damping < kMaxDamping) {
    const Step step = SolveStep(*system, damping, options.num_threads);
    // Below this decrease, rounding decides.
    constexpr double kRounding = 1e-15;
    if (system->cost <= options.negligible_cost || (step.ok && step.predicted <= kRounding * system->cost)) {
      report.status = Status::kOk;
      break;
    }
    bool accepted = false;
    if (step.ok) {
      problem->Try(step.global, step.blocks);
      ++report.num_iterations;
      accepted = problem->LinearizeTrial(&trial) && trial.cost < system->cost;
    }
    if (!accepted) {
      const bool flat = step.ok && step.predicted <= options.cost_tolerance * system->cost;
      if (flat) {
        report.status = Status::kOk;
        break;
      }
      damping *= growth, growth *= 2;
      continue;
    }
    const double decrease = system->cost - trial.cost, gain = decrease / step.predicted;
    problem->AcceptTrial();
    std::swap(*system, trial);
    damping = std::max(kMinDamping, damping * std::max(1.0 / 10, 1 - std::pow(2 * gain - 1, 3)));
    growth = 2;
    if (step.predicted <= options.cost_tolerance * system->cost && decrease <= options.cost_tolerance * system->cost) {
      report.status = Status::kOk;
      break;
    }
  }
  report.cost = system->cost;
  return report;
}

}  // namespace mvstudio::calib
