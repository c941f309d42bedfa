#include "geometry/rigid/rigid3.h"

#include <Eigen/SVD>
#include <cmath>

#include "core/check.h"

namespace mvstudio::geometry {

Eigen::Vector3d operator*(const Rigid3& b_from_a, const Eigen::Vector3d& x_in_a) {
  return b_from_a.rotation * x_in_a + b_from_a.translation;
}

Rigid3 operator*(const Rigid3& c_from_b, const Rigid3& b_from_a) {
  return {(c_from_b.rotation * b_from_a.rotation).normalized(), c_from_b * b_from_a.translation};
}

Rigid3 Inverse(const Rigid3& b_from_a) {
  const Eigen::Quaterniond a_from_b = b_from_a.rotation.conjugate();
  return {a_from_b, -(a_from_b * b_from_a.translation)};
}

Eigen::Matrix4d ToMatrix(const Rigid3& b_from_a) {
  Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
  matrix.topLeftCorner<3, 3>() = b_from_a.rotation.toRotationMatrix();
  matrix.topRightCorner<3, 1>() = b_from_a.translation;
  return matrix;
}

Eigen::Vector3d RotationLog(const Eigen::Quaterniond& rotation) {
  const double sign = std::signbit(rotation.w()) ? -1.0 : 1.0;
  const Eigen::Vector3d v = sign * rotation.vec();
  const double sine = v.stableNorm();
  if (sine == 0) return Eigen::Vector3d::Zero();
  return v * (2.0 * std::atan2(sine, sign * rotation.w()) / sine);
}

Eigen::Quaterniond RotationExp(const Eigen::Vector3d& rotation_vector) {
  const double angle = rotation_vector.stableNorm();
  if (angle == 0) return Eigen::Quaterniond::Identity();
  const Eigen::Vector3d v = rotation_vector * (std::sin(0.5 * angle) / angle);
  return {std::cos(0.5 * angle), v[0], v[1], v[2]};
}

double RotationAngle(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b) {
  const Eigen::Quaterniond difference = a * b.conjugate();
  return 2.0 * std::atan2(difference.vec().stableNorm(), std::abs(difference.w()));
}

Rigid3 Perturb(const Vector6d& delta, const Rigid3& b_from_a) {
  return {(RotationExp(delta.head<3>()) * b_from_a.rotation).normalized(), b_from_a.translation + delta.tail<3>()};
}

Eigen::Quaterniond NearestRotation(const Eigen::Matrix3d& matrix, double* drift) {
  MVS_CHECK(matrix.allFinite(), "the matrix holds NaN or infinity");
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(matrix, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Matrix3d rotation = svd.matrixU() * svd.matrixV().transpose();
  const bool proper = rotation.determinant() > 0 && svd.singularValues()[2] > 1e-14 * svd.singularValues()[0];
  MVS_CHECK(proper,
            "determinant " << matrix.determinant() << " is not positive: no rotation but a reflection or a singular matrix");
  if (drift) *drift = (matrix - rotation).norm();
  return Eigen::Quaterniond(rotation).normalized();
}

}  // namespace mvstudio::geometry
