#include "geometry/solve/least_squares.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/QR>
#include <cmath>
#include <limits>
#include <vector>

#include "core/random.h"
#include "geometry/rigid/cross_matrix.h"
#include "geometry/rigid/rigid3.h"
#include "tests/support/test.h"

namespace mvstudio::geometry {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

/// |a x - b|^2.
template <int N>
struct Linear : LeastSquaresProblem<N, Eigen::Matrix<double, N, 1>> {
  using Vector = Eigen::Matrix<double, N, 1>;
  Eigen::MatrixXd a;
  Eigen::VectorXd b;

  Linear(const Eigen::MatrixXd& matrix, const Eigen::VectorXd& right) : a(matrix), b(right) {}
  Vector Retract(const Vector& x, const Vector& step) const { return x + step; }
  bool Linearize(const Vector& x, NormalEquations<N>* out) const {
    const Eigen::VectorXd residuals = a * x - b;
    out->h = a.transpose() * a, out->g = a.transpose() * residuals, out->cost = residuals.squaredNorm();
    return true;
  }
};

Eigen::MatrixXd Random(Eigen::Index rows, Eigen::Index cols, Rng* rng) {
  return Eigen::MatrixXd::NullaryExpr(rows, cols, [&](Eigen::Index, Eigen::Index) { return rng->Normal(); });
}

TEST(LeastSquares, LinearProblemsAreSolvedInOneStep) {
  Rng rng(1);
  const Eigen::MatrixXd a = Random(12, 3, &rng);
  const Eigen::VectorXd b = Random(12, 1, &rng);
  const Eigen::Vector3d closed = a.householderQr().solve(b);
  LeastSquaresOptions options;
  options.first_damping = 0, options.max_iterations = 1;
  const auto once = SolveLeastSquares(Linear<3>(a, b), Eigen::Vector3d(5, -3, 2), options);
  EXPECT_EQ(once.status, Status::kNotConverged);  // one step does not show that there is no other
  EXPECT_LT((once.state - closed).norm(), 1e-13);
  const auto end = SolveLeastSquares(Linear<3>(a, b), Eigen::Vector3d(5, -3, 2), {});
  EXPECT_EQ(end.status, Status::kOk);
  EXPECT_LT((end.state - closed).norm(), 1e-11);
  EXPECT_LT((end.equations.h - a.transpose() * a).norm(), 1e-13);
  EXPECT_LT(end.equations.g.norm(), 1e-10);
  EXPECT_NEAR(end.equations.cost, (a * closed - b).squaredNorm(), 1e-13);
}

TEST(LeastSquares, AsManyUnknownsAsAreAskedFor) {
  Rng rng(2);
  for (const int n : {1, 2, 9, 20}) {
    const Eigen::MatrixXd a = Random(2 * n, n, &rng);
    const Eigen::VectorXd b = Random(2 * n, 1, &rng);
    const auto end = SolveLeastSquares(Linear<Eigen::Dynamic>(a, b), Eigen::VectorXd::Zero(n), {});
    EXPECT_EQ(end.status, Status::kOk);
    EXPECT_LT((end.state - a.householderQr().solve(b)).norm(), 1e-10) << n << " unknowns";
  }
}

/// Unknowns in other units: the inverse is the same in those units, to the last digits.
TEST(LeastSquares, TheScaledInverseKnowsNoUnits) {
  Rng rng(7);
  const Eigen::MatrixXd a = Random(20, 6, &rng);
  const Eigen::MatrixXd h = a.transpose() * a, inverse = ScaledInverse(h);
  EXPECT_LT((h * inverse - Eigen::MatrixXd::Identity(6, 6)).norm(), 1e-13);
  Eigen::VectorXd units(6);
  units << 1e-9, 1e9, 1, 1e-3, 1e6, 1e12;
  const Eigen::MatrixXd other = units.asDiagonal() * h * units.asDiagonal();
  const Eigen::MatrixXd back = units.asDiagonal() * ScaledInverse(other) * units.asDiagonal();
  EXPECT_LT((back - inverse).norm(), 1e-13 * inverse.norm());
  const Eigen::Matrix<double, 6, 6> fixed = h;
  EXPECT_LT((ScaledInverse(fixed) - inverse).norm(), 1e-13 * inverse.norm());
}

TEST(LeastSquares, ThereIsNoScaledInverseOfWhatIsNotDefinite) {
  Eigen::Matrix2d indefinite, empty;
  indefinite << 1, 2, 2, 1;
  empty << 1, 0, 0, 0;
  EXPECT_FALSE(ScaledInverse(indefinite).array().isFinite().any());
  EXPECT_FALSE(ScaledInverse(empty).array().isFinite().any());
}

struct Rosenbrock : LeastSquaresProblem<2, Eigen::Vector2d> {
  Eigen::Vector2d Retract(const Eigen::Vector2d& x, const Eigen::Vector2d& step) const { return x + step; }
  bool Linearize(const Eigen::Vector2d& x, NormalEquations<2>* out) const {
    const Eigen::Vector2d residuals(10 * (x[1] - x[0] * x[0]), 1 - x[0]);
    Eigen::Matrix2d jacobian;
    jacobian << -20 * x[0], 10, -1, 0;
    out->h = jacobian.transpose() * jacobian, out->g = jacobian.transpose() * residuals;
    out->cost = residuals.squaredNorm();
    return true;
  }
};

TEST(LeastSquares, FollowsRosenbrocksValley) {
  for (const double damping : {0.0, 1e-4, 1.0}) {
    LeastSquaresOptions options;
    options.first_damping = damping, options.max_iterations = 200;
    const auto end = SolveLeastSquares(Rosenbrock(), Eigen::Vector2d(-1.2, 1), options);
    EXPECT_EQ(end.status, Status::kOk);
    EXPECT_LT((end.state - Eigen::Vector2d(1, 1)).norm(), 1e-14);
  }
}

TEST(LeastSquares, EndsWithItsIterationsAndNeverHigher) {
  double last = 24.2;  // at the start
  for (int iterations = 0; iterations < 40; ++iterations) {
    LeastSquaresOptions options;
    options.max_iterations = iterations;
    const auto end = SolveLeastSquares(Rosenbrock(), Eigen::Vector2d(-1.2, 1), options);
    EXPECT_EQ(end.status, Status::kNotConverged);
    EXPECT_EQ(end.iterations, iterations);
    EXPECT_LE(end.equations.cost, last + 1e-12);
    last = end.equations.cost;
  }
}

/// y = b1 (1 - exp(-b2 x)): Misra1a of NIST's Statistical Reference Datasets, certified in extended precision.
struct Misra : LeastSquaresProblem<2, Eigen::Vector2d> {
  Eigen::Vector2d Retract(const Eigen::Vector2d& b, const Eigen::Vector2d& step) const { return b + step; }
  bool Linearize(const Eigen::Vector2d& b, NormalEquations<2>* out) const {
    static constexpr double kX[] = {77.6,  114.9, 141.1, 190.8, 239.9, 289.0, 332.8,
                                    378.4, 434.8, 477.3, 536.8, 593.1, 689.1, 760.0};
    static constexpr double kY[] = {10.07, 14.73, 17.94, 23.93, 29.61, 35.18, 40.02,
                                    44.82, 50.76, 55.05, 61.01, 66.40, 75.47, 81.78};
    for (int i = 0; i < 14; ++i) {
      const double e = std::exp(-b[1] * kX[i]), residual = b[0] * (1 - e) - kY[i];
      const Eigen::Vector2d row(1 - e, b[0] * kX[i] * e);
      out->h += row * row.transpose(), out->g += residual * row, out->cost += residual * residual;
    }
    return true;
  }
};

TEST(LeastSquares, EndsInTheLastDigits) {
  const Eigen::Vector2d certified(2.3894212918E+02, 5.5015643181E-04), sigmas(2.7070075241E+00, 7.2668688436E-06);
  LeastSquaresOptions options;
  options.max_iterations = 500;
  std::vector<Eigen::Vector2d> ends;
  for (const Eigen::Vector2d& start : {Eigen::Vector2d(500, 1e-4), Eigen::Vector2d(250, 5e-4)}) {
    const auto end = SolveLeastSquares(Misra(), start, options);
    EXPECT_EQ(end.status, Status::kOk);
    // A step that lowers the cost, 12 s^2, by 1e-14 of it is 3.5e-7 sigmas long.
    EXPECT_LT((end.state - certified).cwiseQuotient(sigmas).norm(), 3.5e-7);
    EXPECT_NEAR(end.equations.cost, 1.2455138894E-01, 1e-11);
    const Eigen::Matrix2d covariance = end.equations.h.inverse() * end.equations.cost / 12;
    EXPECT_LT((covariance.diagonal().cwiseSqrt() - sigmas).cwiseQuotient(sigmas).norm(), 1e-9);
    ends.push_back(end.state);
  }
  EXPECT_LT((ends[0] - ends[1]).cwiseQuotient(sigmas).norm(), 3.5e-7);
}

TEST(LeastSquares, OpenDirectionsAreTold) {
  Eigen::MatrixXd sum(2, 2), unmet(2, 2);
  sum << 1, 1, 2, 2;
  unmet << 1, 0, 2, 0;
  const Eigen::Vector2d b(1, 2);
  for (const Eigen::MatrixXd& a : {sum, unmet}) {
    LeastSquaresOptions options;
    const auto any = SolveLeastSquares(Linear<2>(a, b), Eigen::Vector2d(3, 4), options);
    EXPECT_EQ(any.status, Status::kOk);  // a minimum, one of many
    EXPECT_LT((a * any.state - b).norm(), 1e-12);
    options.min_pivot = 1e-12;
    EXPECT_EQ(SolveLeastSquares(Linear<2>(a, b), Eigen::Vector2d(3, 4), options).status, Status::kDegenerate);
  }
  EXPECT_EQ(SmallestPivot(Eigen::Matrix2d(unmet.transpose() * unmet)), 0);
  EXPECT_NEAR(SmallestPivot(Eigen::Matrix2d(Eigen::Vector2d(1e-20, 1e20).asDiagonal())), 1, 1e-15);  // units do not matter
}

TEST(LeastSquares, NumbersThatAreNoneAreRefused) {
  const Eigen::MatrixXd a = Eigen::MatrixXd::Identity(3, 2);
  Eigen::VectorXd b = Eigen::Vector3d(1, 2, 3);
  auto end = SolveLeastSquares(Linear<2>(a, b), Eigen::Vector2d(kNaN, 0), {});
  EXPECT_EQ(end.status, Status::kNonFiniteInput);
  EXPECT_EQ(end.iterations, 0);
  b[1] = std::numeric_limits<double>::infinity();
  EXPECT_EQ(SolveLeastSquares(Linear<2>(a, b), Eigen::Vector2d(0, 0), {}).status, Status::kNonFiniteInput);
}

/// Rotation that takes points to others.
struct Turn : LeastSquaresProblem<3, Eigen::Quaterniond> {
  Eigen::Matrix3Xd from, to;

  Turn(const Eigen::Matrix3Xd& points, const Eigen::Matrix3Xd& rotated) : from(points), to(rotated) {}
  Eigen::Quaterniond Retract(const Eigen::Quaterniond& q, const Eigen::Vector3d& step) const {
    return (RotationExp(step) * q).normalized();
  }
  bool Linearize(const Eigen::Quaterniond& q, NormalEquations<3>* out) const {
    for (Eigen::Index i = 0; i < from.cols(); ++i) {
      const Eigen::Vector3d rotated = q * Eigen::Vector3d(from.col(i)), residual = rotated - to.col(i);
      const Eigen::Matrix3d jacobian = -CrossMatrix(rotated);
      out->h += jacobian.transpose() * jacobian, out->g += jacobian.transpose() * residual;
      out->cost += residual.squaredNorm();
    }
    return true;
  }
};

TEST(LeastSquares, StatesMayBeRotations) {
  Rng rng(3);
  for (int k = 0; k < 20; ++k) {
    const Eigen::Matrix3Xd from = Random(3, 8, &rng);
    const Eigen::Vector3d axis = Eigen::Vector3d(rng.Normal(), rng.Normal(), rng.Normal()).normalized();
    const Eigen::Quaterniond truth = RotationExp(1.5 * axis);
    const Eigen::Matrix3Xd to = truth.toRotationMatrix() * from;
    const auto end = SolveLeastSquares(Turn(from, to), Eigen::Quaterniond::Identity(), {});
    EXPECT_EQ(end.status, Status::kOk);
    EXPECT_LT(RotationAngle(end.state, truth), 1e-14);
  }
}

/// log(x)^2, which is not defined for x <= 0: from x > e the undamped step leads there.
struct Logarithm : LeastSquaresProblem<1, double> {
  double Retract(double x, const Step& step) const { return x + step[0]; }
  bool Linearize(double x, NormalEquations<1>* out) const {
    if (!(x > 0)) return false;
    const double r = std::log(x);
    out->h(0, 0) = 1 / (x * x), out->g[0] = r / x, out->cost = r * r;
    return true;
  }
};

TEST(LeastSquares, StepsToWhereThereIsNothingAreRefused) {
  for (const double start : {2.0, 10.0, 100.0}) {
    LeastSquaresOptions options;
    options.first_damping = 0;
    const auto end = SolveLeastSquares(Logarithm(), start, options);
    EXPECT_EQ(end.status, Status::kOk);
    EXPECT_NEAR(end.state, 1, 1e-14);
  }
  EXPECT_EQ(SolveLeastSquares(Logarithm(), -1.0, {}).status, Status::kNonFiniteInput);
  LeastSquaresOptions little;
  little.first_damping = 0, little.max_damping = 1e-4;
  EXPECT_EQ(SolveLeastSquares(Logarithm(), 100.0, little).status, Status::kNotConverged);
}

struct WithCost : Rosenbrock {
  static constexpr bool kHasCost = true;
  int* linearized;

  explicit WithCost(int* count) : linearized(count) {}
  double Cost(const Eigen::Vector2d& x) const {
    NormalEquations<2> all;
    Rosenbrock::Linearize(x, &all);
    return all.cost;
  }
  bool Linearize(const Eigen::Vector2d& x, NormalEquations<2>* out) const {
    ++*linearized;
    return Rosenbrock::Linearize(x, out);
  }
};

TEST(LeastSquares, ACostSparesTheEquationsOfRefusedSteps) {
  LeastSquaresOptions options;
  options.max_iterations = 200;
  int linearized = 0;
  const auto with = SolveLeastSquares(WithCost(&linearized), Eigen::Vector2d(-1.2, 1), options);
  const auto without = SolveLeastSquares(Rosenbrock(), Eigen::Vector2d(-1.2, 1), options);
  EXPECT_EQ(with.status, Status::kOk);
  EXPECT_EQ(with.iterations, without.iterations);
  EXPECT_EQ(with.state, without.state);
  EXPECT_EQ(with.equations.h, without.equations.h);
  EXPECT_EQ(with.equations.cost, without.equations.cost);
  EXPECT_LT(linearized, with.iterations);
}

/// Says itself what becomes of every step.
struct Verdict : Rosenbrock {
  StepVerdict verdict;

  explicit Verdict(StepVerdict all) : verdict(all) {}
  StepVerdict Judge(const LeastSquaresOptions&, const Step&, const NormalEquations<2>&, const NormalEquations<2>*) const {
    return verdict;
  }
};

TEST(LeastSquares, ProblemsMayJudgeTheirSteps) {
  const Eigen::Vector2d start(-1.2, 1);
  const auto rest = SolveLeastSquares(Verdict(StepVerdict::kRest), start, {});
  EXPECT_EQ(rest.status, Status::kOk);
  EXPECT_EQ(rest.state, start);
  const auto last = SolveLeastSquares(Verdict(StepVerdict::kTakeLast), start, {});
  EXPECT_EQ(last.status, Status::kOk);
  EXPECT_EQ(last.iterations, 1);
  EXPECT_NE(last.state, start);
  const auto refused = SolveLeastSquares(Verdict(StepVerdict::kRefuse), start, {});
  EXPECT_EQ(refused.status, Status::kNotConverged);
  EXPECT_EQ(refused.iterations, 14);  // 1e-4 to 1e10
  EXPECT_EQ(refused.state, start);
}

struct NoStep : Rosenbrock {
  Eigen::Vector2d SolveStep(const NormalEquations<2>&, double) const { return Eigen::Vector2d(kNaN, 0); }
};

TEST(LeastSquares, WithoutAStepThereIsNoEnd) {
  const Eigen::Vector2d start(-1.2, 1);
  const auto end = SolveLeastSquares(NoStep(), start, {});
  EXPECT_EQ(end.status, Status::kDegenerate);
  EXPECT_EQ(end.state, start);
}

TEST(LeastSquares, DampingIsRelativeOrAbsolute) {
  const Eigen::Matrix2d h = Eigen::Vector2d(1, 1e6).asDiagonal();
  const Eigen::Vector2d g(1, 1e6);
  EXPECT_LT((DampedStep<2>(h, g, 1) + Eigen::Vector2d(0.5, 0.5)).norm(), 1e-15);
  EXPECT_LT((DampedStep<2>(h, g, 0, 1) + Eigen::Vector2d(0.5, 1e6 / (1e6 + 1))).norm(), 1e-15);
}

}  // namespace
}  // namespace mvstudio::geometry
