#pragma once

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "core/status.h"

/// Damped least squares with few unknowns and a dense matrix: Marquardt, J. SIAM 11, 1963, with the stopping rules of Madsen,
/// Nielsen and Tingleff, Methods for Non-Linear Least Squares Problems, 2004. Where the equations have many blocks, and for
/// damping by the gain ratio (Nielsen, IMM-REP-1999-05): calib/bundle/schur_lm.h. docs/decisions/0009 says who uses it.
namespace mvstudio::geometry {

struct LeastSquaresOptions {
  int max_iterations = 50;  ///< steps tried
  double first_damping = 1e-4;
  double raise = 10, lower = 10;  ///< factors of the damping after a refused and after a taken step
  double first_raise = 1e-3;      ///< damping after a refused step that had none
  double none_below = 0;          ///< a damping below it is followed by none
  double least_damping = 0;
  double max_damping = 1e10;      ///< no step is tried with so much
  double cost_tolerance = 1e-14;  ///< at rest when a taken step lowers the cost by no more than this part of it
  double step_tolerance = 0;      ///< or is shorter than this
  double min_pivot = 0;           ///< of h scaled to a unit diagonal: a minimum with a smaller one is kDegenerate
};

/// Sums over the residuals at one state, for N unknowns or Eigen::Dynamic many.
template <int N>
struct NormalEquations {
  static constexpr int kSize = N == Eigen::Dynamic ? 0 : N;
  Eigen::Matrix<double, N, N> h = Eigen::Matrix<double, N, N>::Zero(kSize, kSize);  ///< J^T W J
  Eigen::Matrix<double, N, 1> g = Eigen::Matrix<double, N, 1>::Zero(kSize);         ///< J^T W r
  double cost = 0;                                                                  ///< what is minimised
};

/// Solution d of (h + relative diag(h) + absolute) d = -g.
template <int N>
Eigen::Matrix<double, N, 1> DampedStep(const Eigen::Matrix<double, N, N>& h, const Eigen::Matrix<double, N, 1>& g,
                                       double relative, double absolute = 0) {
  Eigen::Matrix<double, N, N> damped = h;
  damped.diagonal() *= 1 + relative;
  damped.diagonal().array() += absolute;
  return damped.ldlt().solve(-g);
}

/// Least pivot of h scaled to a unit diagonal; 0 where no residual meets an unknown.
template <int N>
double SmallestPivot(const Eigen::Matrix<double, N, N>& h) {
  if (!(h.diagonal().minCoeff() > 0)) return 0;
  const Eigen::Matrix<double, N, 1> scale = h.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::Matrix<double, N, N> scaled = scale.asDiagonal() * h * scale.asDiagonal();
  return scaled.ldlt().vectorD().minCoeff();
}

/// Inverse of h, taken with a unit diagonal: the units of the unknowns make no difference to its accuracy. NaN where h is not
/// positive definite.
template <int N>
Eigen::Matrix<double, N, N> ScaledInverse(const Eigen::Matrix<double, N, N>& h) {
  using Matrix = Eigen::Matrix<double, N, N>;
  const Matrix none = Matrix::Constant(h.rows(), h.cols(), std::numeric_limits<double>::quiet_NaN());
  if (!(h.diagonal().minCoeff() > 0)) return none;
  const Eigen::Matrix<double, N, 1> scale = h.diagonal().cwiseSqrt().cwiseInverse();
  const Matrix scaled = scale.asDiagonal() * h * scale.asDiagonal();
  const Eigen::LLT<Matrix> factor(scaled);
  if (factor.info() != Eigen::Success) return none;
  const Matrix inverse = factor.solve(Matrix::Identity(h.rows(), h.cols()));
  return scale.asDiagonal() * inverse * scale.asDiagonal();
}

enum class StepVerdict {
  kRefuse,    ///< more damping
  kTake,      ///< less damping
  kTakeLast,  ///< at rest where the step leads
  kRest,      ///< at rest without it
};

/// What every problem has and may replace. It adds:
///   bool Linearize(const State&, Equations*) const;     into fresh equations; false: no state to be in
///   State Retract(const State&, const Step&) const;
///   double Cost(const State&) const;                    with kHasCost, where it takes less time; infinite: no state to be in
template <int N, class StateType, class EquationsType = NormalEquations<N>>
struct LeastSquaresProblem {
  using State = StateType;
  using Equations = EquationsType;  ///< NormalEquations<N> or derived from it
  using Step = Eigen::Matrix<double, N, 1>;
  static constexpr bool kHasCost = false;

  /// Not finite where there is none.
  Step SolveStep(const Equations& at, double damping) const { return DampedStep(at.h, at.g, damping); }

  /// `trial` is null where the step leads to no state; with kHasCost it has nothing but the cost.
  StepVerdict Judge(const LeastSquaresOptions& options, const Step& step, const Equations& at, const Equations* trial) const {
    if (!trial || !(trial->cost <= at.cost)) return StepVerdict::kRefuse;
    const bool flat = at.cost - trial->cost <= options.cost_tolerance * at.cost;
    return flat || step.norm() < options.step_tolerance ? StepVerdict::kTakeLast : StepVerdict::kTake;
  }
};

template <class Problem>
struct LeastSquaresEnd {
  /// kOk: at rest; kNotConverged; kDegenerate: no finite step, or min_pivot; kNonFiniteInput: no equations at the start, or
  /// none where there was a cost
  Status status = Status::kOk;
  typename Problem::State state;
  typename Problem::Equations equations;  ///< at `state`
  int iterations = 0;
};

namespace least_squares_internal {

/// What a step is judged by.
template <class Problem>
bool Try(const Problem& problem, const typename Problem::State& at, typename Problem::Equations* equations) {
  if constexpr (Problem::kHasCost) {
    equations->cost = problem.Cost(at);
    return std::isfinite(equations->cost);
  } else {
    return problem.Linearize(at, equations) && std::isfinite(equations->cost);
  }
}

/// What a taken step needs beyond that.
template <class Problem>
bool Complete(const Problem& problem, const typename Problem::State& at, typename Problem::Equations* equations) {
  if constexpr (!Problem::kHasCost) return true;
  const double cost = equations->cost;
  const bool ok = problem.Linearize(at, equations);
  equations->cost = cost;
  return ok;
}

inline double Raised(const LeastSquaresOptions& options, double damping) {
  return damping == 0 ? options.first_raise : damping * options.raise;
}

inline double Lowered(const LeastSquaresOptions& options, double damping) {
  return damping < options.none_below ? 0 : std::max(damping / options.lower, options.least_damping);
}

/// One step, taken or refused; kNotConverged: go on.
template <class Problem>
Status Iterate(const Problem& problem, const LeastSquaresOptions& options, double* damping, LeastSquaresEnd<Problem>* at) {
  const typename Problem::Step step = problem.SolveStep(at->equations, *damping);
  if (!step.allFinite()) return Status::kDegenerate;
  typename Problem::State next = problem.Retract(at->state, step);
  typename Problem::Equations trial;
  const bool possible = Try(problem, next, &trial);
  const StepVerdict verdict = problem.Judge(options, step, at->equations, possible ? &trial : nullptr);
  if (verdict == StepVerdict::kRest) return Status::kOk;
  if (verdict == StepVerdict::kRefuse) {
    *damping = Raised(options, *damping);
    return Status::kNotConverged;
  }
  if (!Complete(problem, next, &trial)) return Status::kNonFiniteInput;
  at->state = std::move(next), at->equations = std::move(trial);
  *damping = Lowered(options, *damping);
  return verdict == StepVerdict::kTakeLast ? Status::kOk : Status::kNotConverged;
}

}  // namespace least_squares_internal

/// No memory is allocated for a fixed number of unknowns, unless the problem does so.
template <class Problem>
LeastSquaresEnd<Problem> SolveLeastSquares(const Problem& problem, const typename Problem::State& start,
                                           const LeastSquaresOptions& options) {
  using namespace least_squares_internal;
  LeastSquaresEnd<Problem> end{Status::kNonFiniteInput, start, {}, 0};
  if (!Try(problem, start, &end.equations) || !Complete(problem, start, &end.equations)) return end;
  double damping = options.first_damping;
  end.status = Status::kNotConverged;
  while (end.status == Status::kNotConverged && end.iterations < options.max_iterations && damping < options.max_damping) {
    ++end.iterations;
    end.status = Iterate(problem, options, &damping, &end);
  }
  const bool asked = end.status == Status::kOk && options.min_pivot > 0;
  if (asked && !(SmallestPivot(end.equations.h) >= options.min_pivot)) end.status = Status::kDegenerate;
  return end;
}

}  // namespace mvstudio::geometry
