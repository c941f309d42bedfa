#pragma once

#include <Eigen/Core>

#include "avatar/splats/cloud.h"

/// Colour of a Gaussian from the direction in which it is seen: 0.5 + sum of coefficients times real spherical harmonics, not
/// below 0; signs and order as in Kerbl et al., "3D Gaussian Splatting for Real-Time Radiance Field Rendering", TOG 2023.
namespace mvstudio::splats {

/// Values of the harmonics of a unit direction; only the first BasisSize(degree) are set.
template <class S>
void EvaluateBasis(const Eigen::Matrix<S, 3, 1>& direction, int degree, S* basis);

/// Their derivatives with respect to the direction's coordinates, taken as independent: 3 numbers a harmonic.
template <class S>
void EvaluateBasisGradient(const Eigen::Matrix<S, 3, 1>& direction, int degree, S* gradient);

/// Coefficients that give the same colours when directions are turned: basis(d) . c = basis(b_from_a d) . out, for the
/// BasisSize(degree) coefficients of one channel. Exact for a rotation.
void RotateCoefficients(const Eigen::Matrix3d& b_from_a, int degree, const double* coefficients, double* out);

extern template void EvaluateBasis(const Eigen::Matrix<float, 3, 1>&, int, float*);
extern template void EvaluateBasis(const Eigen::Matrix<double, 3, 1>&, int, double*);
extern template void EvaluateBasisGradient(const Eigen::Matrix<float, 3, 1>&, int, float*);
extern template void EvaluateBasisGradient(const Eigen::Matrix<double, 3, 1>&, int, double*);

/// The harmonic of degree 0, a constant: the coefficient of a colour v is (v - 0.5) / kBasis0.
inline constexpr double kBasis0 = 0.28209479177387814;

}  // namespace mvstudio::splats
