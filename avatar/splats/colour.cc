#include "avatar/splats/colour.h"

#include <Eigen/LU>

namespace mvstudio::splats {
namespace {

constexpr double kBasis1 = 0.4886025119029199;
constexpr double kBasis2[5] = {1.0925484305920792, -1.0925484305920792, 0.31539156525252005, -1.0925484305920792,
                               0.5462742152960396};

}  // namespace

template <class S>
void EvaluateBasis(const Eigen::Matrix<S, 3, 1>& d, int degree, S* basis) {
  const S x = d[0], y = d[1], z = d[2];
  basis[0] = S(kBasis0);
  if (degree < 1) return;
  basis[1] = S(-kBasis1) * y, basis[2] = S(kBasis1) * z, basis[3] = S(-kBasis1) * x;
  if (degree < 2) return;
  basis[4] = S(kBasis2[0]) * x * y;
  basis[5] = S(kBasis2[1]) * y * z;
  basis[6] = S(kBasis2[2]) * (2 * z * z - x * x - y * y);
  basis[7] = S(kBasis2[3]) * x * z;
  basis[8] = S(kBasis2[4]) * (x * x - y * y);
}

template <class S>
void EvaluateBasisGradient(const Eigen::Matrix<S, 3, 1>& d, int degree, S* gradient) {
  const S x = d[0], y = d[1], z = d[2];
  const auto set = [gradient](int i, S dx, S dy, S dz) {
    gradient[3 * i] = dx, gradient[3 * i + 1] = dy, gradient[3 * i + 2] = dz;
  };
  set(0, 0, 0, 0);
  if (degree < 1) return;
  set(1, 0, S(-kBasis1), 0), set(2, 0, 0, S(kBasis1)), set(3, S(-kBasis1), 0, 0);
  if (degree < 2) return;
  set(4, S(kBasis2[0]) * y, S(kBasis2[0]) * x, 0);
  set(5, 0, S(kBasis2[1]) * z, S(kBasis2[1]) * y);
  set(6, S(-2 * kBasis2[2]) * x, S(-2 * kBasis2[2]) * y, S(4 * kBasis2[2]) * z);
  set(7, S(kBasis2[3]) * z, 0, S(kBasis2[3]) * x);
  set(8, S(2 * kBasis2[4]) * x, S(-2 * kBasis2[4]) * y, 0);
}

void RotateCoefficients(const Eigen::Matrix3d& b_from_a, int degree, const double* coefficients, double* out) {
  // Harmonics up to a degree turn into each other: as many directions as harmonics fix the matrix.
  const int n = BasisSize(degree);
  constexpr int kMost = BasisSize(kMaxDegree);
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMost, kMost> in_a(n, n), in_b(n, n);
  const double directions[kMost][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1},  {-1, 0, 0}, {1, 1, 0},
                                       {0, 1, 1}, {1, 0, 1}, {1, -1, 1}, {-1, 2, 1}};
  for (int i = 0; i < n; ++i) {
    const Eigen::Vector3d d = Eigen::Vector3d(directions[i][0], directions[i][1], directions[i][2]).normalized();
    double basis[kMost] = {};
    EvaluateBasis<double>(d, degree, basis);
    for (int k = 0; k < n; ++k) in_a(i, k) = basis[k];
    EvaluateBasis<double>(b_from_a * d, degree, basis);
    for (int k = 0; k < n; ++k) in_b(i, k) = basis[k];
  }
  const Eigen::VectorXd c = Eigen::Map<const Eigen::VectorXd>(coefficients, n);
  Eigen::Map<Eigen::VectorXd>(out, n) = in_b.fullPivLu().solve(in_a * c);
}

template void EvaluateBasis(const Eigen::Matrix<float, 3, 1>&, int, float*);
template void EvaluateBasis(const Eigen::Matrix<double, 3, 1>&, int, double*);
template void EvaluateBasisGradient(const Eigen::Matrix<float, 3, 1>&, int, float*);
template void EvaluateBasisGradient(const Eigen::Matrix<double, 3, 1>&, int, double*);

}  // namespace mvstudio::splats
