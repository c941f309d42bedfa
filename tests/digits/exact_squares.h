#pragma once

#include <Eigen/Cholesky>
#include <functional>

#include "tests/support/mp.h"

/// Nonlinear least squares in MPFR: the oracle of adjustments.
namespace mvstudio::testing {

using VectorXmp = Eigen::Matrix<Mp, Eigen::Dynamic, 1>;
using MatrixXmp = Eigen::Matrix<Mp, Eigen::Dynamic, Eigen::Dynamic>;

struct ExactSquares {
  bool found = false;     ///< the last step was below 1e-25
  VectorXmp moved;        ///< (n) from the start
  MatrixXmp information;  ///< (n, n) J^T J
  Mp cost = 0;            ///< sum of squares
};

/// Least sum of squared `residuals` by Gauss-Newton from zero. Derivatives by central differences of 1e-35, right to 60 digits.
inline ExactSquares SolveExactly(int num_unknowns, const std::function<VectorXmp(const VectorXmp&)>& residuals,
                                 int most_steps = 80) {
  const Mp h("1e-35");
  ExactSquares out;
  out.moved = VectorXmp::Zero(num_unknowns);
  for (int step = 0; step < most_steps; ++step) {
    const VectorXmp r = residuals(out.moved);
    MatrixXmp jacobian(r.size(), num_unknowns);
    for (int k = 0; k < num_unknowns; ++k) {
      VectorXmp up = out.moved, down = out.moved;
      up[k] += h, down[k] -= h;
      jacobian.col(k) = (residuals(up) - residuals(down)) / (2 * h);
    }
    out.information = jacobian.transpose() * jacobian;
    out.cost = r.squaredNorm();
    const VectorXmp move = out.information.ldlt().solve(jacobian.transpose() * r);
    out.moved -= move;
    if (move.norm() < Mp("1e-25")) {
      out.found = true;
      return out;
    }
  }
  return out;
}

}  // namespace mvstudio::testing
