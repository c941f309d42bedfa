#pragma once

#include <Eigen/Geometry>

namespace mvstudio::geometry {

using Vector6d = Eigen::Matrix<double, 6, 1>;

/// Rigid transform: `x_in_b = b_from_a * x_in_a`. Adjacent frame names cancel: `c_from_a = c_from_b * b_from_a`.
struct Rigid3 {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();  // unit
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();         // metres
};

Eigen::Vector3d operator*(const Rigid3& b_from_a, const Eigen::Vector3d& x_in_a);
Rigid3 operator*(const Rigid3& c_from_b, const Rigid3& b_from_a);
/// a_from_b.
Rigid3 Inverse(const Rigid3& b_from_a);
/// [R t; 0 1].
Eigen::Matrix4d ToMatrix(const Rigid3& b_from_a);

/// Rotation vector (axis times angle, radians) of a unit quaternion, angle in [0, pi]; exact near 0 and near pi.
Eigen::Vector3d RotationLog(const Eigen::Quaterniond& rotation);
Eigen::Quaterniond RotationExp(const Eigen::Vector3d& rotation_vector);
/// Angle between two rotations, radians.
double RotationAngle(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b);

/// Left perturbation: rotation Exp(delta.head<3>()) * R, translation t + delta.tail<3>(). Covariances of transforms use this
/// order and this side.
Rigid3 Perturb(const Vector6d& delta, const Rigid3& b_from_a);

/// Nearest rotation to a 3x3 matrix in the Frobenius norm; `drift`, when given, receives |M - R|_F. Throws ContractViolation
/// when M is not finite or its determinant is not positive.
Eigen::Quaterniond NearestRotation(const Eigen::Matrix3d& matrix, double* drift = nullptr);

}  // namespace mvstudio::geometry
