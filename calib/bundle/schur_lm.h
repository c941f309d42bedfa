#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/status.h"

namespace mvstudio::calib {

/// Normal equations of a least-squares problem whose unknowns are n global ones (cameras) and B small blocks of e numbers that
/// never meet in one residual (poses of boards, points). With J the Jacobian and r the residuals: h = J^T J, g = J^T r.
struct SchurSystem {
  double cost = 0;         ///< sum of squared residuals
  Eigen::MatrixXd h;       ///< (n, n), lower triangle
  Eigen::VectorXd g;       ///< (n)
  Eigen::MatrixXd block_h; ///< (e, e * B)
  Eigen::MatrixXd block_g; ///< (e, B)
  Eigen::MatrixXd w;       ///< (e, columns.size()): block times global
  std::vector<int> columns;         ///< global unknowns that each block meets, block after block
  std::vector<Eigen::Index> begin;  ///< (B + 1) first of each block in `columns`

  int block_dim() const { return static_cast<int>(block_h.rows()); }
  int num_blocks() const { return static_cast<int>(block_g.cols()); }
  /// Sets all numbers, but not the structure, to zero.
  void SetZero();
};

/// Sizes the system; `columns_of_block` lists the global unknowns that each block meets.
void Allocate(int num_global, int block_dim, const std::vector<std::vector<int>>& columns_of_block, SchurSystem* system);

/// A problem that SolveSchurLm can solve. It holds a current point and a trial point.
class SchurProblem {
 public:
  virtual ~SchurProblem() = default;
  /// Trial point = current point moved by `global` (n) and `blocks` (e, B).
  virtual void Try(const Eigen::VectorXd& global, const Eigen::MatrixXd& blocks) = 0;
  /// Fills the numbers of `system`, whose structure is allocated, at the trial point; false where a residual is undefined.
  virtual bool LinearizeTrial(SchurSystem* system) = 0;
  virtual void AcceptTrial() = 0;
};

struct SchurLmOptions {
  int max_iterations = 100;
  double cost_tolerance = 1e-12;  ///< relative decrease below which the solution counts as found
  double first_damping = 1e-4;    ///< smaller from a start that is nearly the solution
  double negligible_cost = 0;     ///< a cost that is rounding alone
  int num_threads = 1;
};

struct SchurLmReport {
  Status status = Status::kOk;  ///< kNotConverged; kBehindCamera: a residual is undefined at the start
  double cost = 0;
  int num_iterations = 0;  ///< linearizations
};

/// Levenberg-Marquardt steps (Marquardt 1963; damping after Nielsen 1999) with the blocks eliminated by the Schur complement
/// (Brown 1958; Triggs et al. 1999). Every trial is linearized at once, since nearly all are accepted. `system` must be
/// allocated; it ends at the solution. The result does not depend on the number of threads.
SchurLmReport SolveSchurLm(SchurProblem* problem, SchurSystem* system, const SchurLmOptions& options);

/// h - sum w^T (block_h + damping diag(block_h))^-1 w (lower triangle), the same for g: the equations of the global unknowns
/// alone.
struct ReducedSystem {
  Eigen::MatrixXd h;  // (n, n) lower
  Eigen::VectorXd g;  // (n)
};
ReducedSystem Reduce(const SchurSystem& system, double damping, int num_threads);

}  // namespace mvstudio::calib
