#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/status.h"

namespace mvstudio::calib {

/// Normal equations of a least-squares problem with n global unknowns (cameras) and B small blocks of e unknowns (board
/// poses, points). No residual involves two blocks. With J the Jacobian and r the residuals: h = J^T J, g = J^T r.
struct SchurSystem {
  double cost = 0;         ///< sum of squared residuals
  Eigen::MatrixXd h;       ///< (n, n), lower triangle
  Eigen::VectorXd g;       ///< (n)
  Eigen::MatrixXd block_h; ///< (e, e * B)
  Eigen::MatrixXd block_g; ///< (e, B)
  Eigen::MatrixXd w;       ///< (e, columns.size()): block times global
  std::vector<int> columns;         ///< global unknowns coupled to each block, block after block
  std::vector<Eigen::Index> begin;  ///< (B + 1) first of each block in `columns`

  int block_dim() const { return static_cast<int>(block_h.rows()); }
  int num_blocks() const { return static_cast<int>(block_g.cols()); }
  /// Sets all values to zero but keeps the structure.
  void SetZero();
};

/// Sizes the system; `columns_of_block` lists the global unknowns that each block is coupled to.
void Allocate(int num_global, int block_dim, const std::vector<std::vector<int>>& columns_of_block, SchurSystem* system);

/// A problem that SolveSchurLm can solve. It holds a current point and a trial point.
class SchurProblem {
 public:
  virtual ~SchurProblem() = default;
  /// Trial point = current point moved by `global` (n) and `blocks` (e, B).
  virtual void Try(const Eigen::VectorXd& global, const Eigen::MatrixXd& blocks) = 0;
  /// Fills the values of `system`, whose structure is allocated, at the trial point; false where a residual is undefined.
  virtual bool LinearizeTrial(SchurSystem* system) = 0;
  virtual void AcceptTrial() = 0;
};

struct SchurLmOptions {
  int max_iterations = 100;
  double cost_tolerance = 1e-12;  ///< relative decrease below which the solution has converged
  double first_damping = 1e-4;    ///< choose it smaller for a start near the solution
  double negligible_cost = 0;     ///< cost at the level of rounding errors
  int num_threads = 1;
};

struct SchurLmReport {
  Status status = Status::kOk;  ///< kNotConverged; kUndefined: a residual has no value at the start
  double cost = 0;
  int num_iterations = 0;  ///< linearizations
};

/// Levenberg-Marquardt (Marquardt 1963; damping after Nielsen 1999) with the blocks eliminated by the Schur complement
/// (Brown 1958; Triggs et al. 1999). Every trial is linearized at once, since nearly all are accepted. `system` must be
/// allocated; on return it is linearized at the solution. The result does not depend on the number of threads.
SchurLmReport SolveSchurLm(SchurProblem* problem, SchurSystem* system, const SchurLmOptions& options);

/// Equations of the global unknowns alone: h - sum w^T (block_h + damping diag(block_h))^-1 w (lower triangle), and the
/// same for g.
struct ReducedSystem {
  Eigen::MatrixXd h;  // (n, n) lower
  Eigen::VectorXd g;  // (n)
};
ReducedSystem Reduce(const SchurSystem& system, double damping, int num_threads);

}  // namespace mvstudio::calib
