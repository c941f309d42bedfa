#pragma once

#include <Eigen/Core>

/// Decompositions of matrices of common shapes, compiled once: Eigen's take seconds to compile in every file that uses
/// them.
namespace mvstudio::geometry {

/// The rotation R that maximises trace(R^T m): U diag(1, 1, det(U V^T)) V^T of m = U S V^T (Kabsch, Acta Cryst. A32,
/// 1976). With m = sum of b a^T it rotates the points a closest to the points b.
Eigen::Matrix3d ProcrustesRotation(const Eigen::Matrix3d& m);

/// Singular values, descending (Jacobi: accurate also for the small ones).
Eigen::VectorXd SingularValues(const Eigen::MatrixXd& m);

/// Eigenvalues of a symmetric matrix, ascending; its lower triangle is read.
Eigen::Vector3d SymmetricEigenvalues(const Eigen::Matrix3d& m);

}  // namespace mvstudio::geometry
