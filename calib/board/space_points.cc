#include "calib/board/space_points.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

namespace mvstudio::calib {
namespace {

using Eigen::Index;
using PinholeMatrix = Eigen::Matrix<double, 3, 4>;

constexpr double kOffPlane = 1.0 / 30;  // of the extent
constexpr Index kMinPoints = 6;

Eigen::Matrix3d CrossOf(const Eigen::Vector3d& v) {
  Eigen::Matrix3d cross;
  cross << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return cross;
}

/// Moves points to a mean of zero and a size of about one: x -> (x - mean) / size.
Eigen::Matrix4d SpaceNormalizer(const Eigen::Matrix3Xd& points) {
  const Eigen::Vector3d mean = points.rowwise().mean();
  const double size = std::sqrt((points.colwise() - mean).squaredNorm() / static_cast<double>(points.cols()));
  Eigen::Matrix4d normalize = Eigen::Matrix4d::Identity();
  normalize.topLeftCorner<3, 3>() /= size;
  normalize.topRightCorner<3, 1>() = -mean / size;
  return normalize;
}

}  // namespace

bool SpansSpace(const Eigen::Matrix3Xd& points, const Eigen::VectorXd& weights) {
  Eigen::Matrix3Xd kept(3, points.cols());
  Index n = 0;
  for (Index i = 0; i < points.cols(); ++i) {
    if (weights.size() == 0 || weights[i] > 0) kept.col(n++) = points.col(i);
  }
  if (n < kMinPoints) return false;
  kept.conservativeResize(3, n);
  const Eigen::Matrix3Xd centred = kept.colwise() - Eigen::Vector3d(kept.rowwise().mean());
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> spread(Eigen::Matrix3d(centred * centred.transpose()));
  return spread.eigenvalues()[0] > kOffPlane * kOffPlane * spread.eigenvalues()[2];
}

std::optional<PinholeMatrix> FitProjection(const Eigen::Matrix3Xd& points, const Eigen::Matrix3Xd& rays) {
  if (!SpansSpace(points)) return std::nullopt;
  const Eigen::Matrix4d normalize = SpaceNormalizer(points);
  Eigen::MatrixXd rows(3 * points.cols(), 12);
  for (Index i = 0; i < points.cols(); ++i) {
    const Eigen::Vector4d x = normalize * points.col(i).homogeneous();
    const Eigen::Matrix3d cross = CrossOf(rays.col(i).normalized());
    for (int k = 0; k < 4; ++k) rows.block<3, 3>(3 * i, 3 * k) = x[k] * cross;
  }
  const Eigen::HouseholderQR<Eigen::MatrixXd> qr(rows);
  const Eigen::Matrix<double, 12, 12> triangle = qr.matrixQR().topRows<12>().triangularView<Eigen::Upper>();
  const Eigen::JacobiSVD<Eigen::Matrix<double, 12, 12>> svd(triangle, Eigen::ComputeFullV);
  constexpr double kMinRatio = 1e-7;
  if (!(svd.singularValues()[10] > kMinRatio * svd.singularValues()[0])) return std::nullopt;
  const Eigen::Matrix<double, 12, 1> p = svd.matrixV().col(11);
  PinholeMatrix projection = Eigen::Map<const PinholeMatrix>(p.data()) * normalize;
  double side = 0;
  for (Index i = 0; i < points.cols(); ++i) side += rays.col(i).normalized().dot(projection * points.col(i).homogeneous());
  return side < 0 ? PinholeMatrix(-projection) : projection;
}

std::optional<geometry::Rigid3> PoseInSpace(const Eigen::Matrix3Xd& points, const Eigen::Matrix3Xd& rays) {
  const auto projection = FitProjection(points, rays);
  if (!projection) return std::nullopt;
  const Eigen::Matrix3d m = projection->leftCols<3>();
  const double scale = std::cbrt(m.determinant());
  if (!(scale > 0)) return std::nullopt;
  geometry::Rigid3 pose;
  pose.rotation = geometry::NearestRotation(Eigen::Matrix3d(m / scale));
  // The centre stays where it is, whatever the nearest rotation turns.
  const Eigen::Vector3d centre = -m.inverse() * projection->col(3);
  pose.translation = -(pose.rotation * centre);
  return pose.translation.allFinite() ? std::optional(pose) : std::nullopt;
}

std::optional<double> FocalInSpace(const Eigen::Matrix3Xd& points, const Eigen::Matrix2Xd& px, int width_px, int height_px) {
  const Eigen::Vector2d centre((width_px - 1) / 2.0, (height_px - 1) / 2.0);
  const double size = std::max(width_px, height_px);
  const auto projection = FitProjection(points, ((px.colwise() - centre) / size).colwise().homogeneous());
  if (!projection) return std::nullopt;
  const Eigen::Matrix3d m = projection->leftCols<3>(), k = m * m.transpose() / m.row(2).squaredNorm();  // K K^T
  const double fx2 = k(0, 0) - k(0, 2) * k(0, 2), fy2 = k(1, 1) - k(1, 2) * k(1, 2);
  if (!(fx2 > 0) || !(fy2 > 0)) return std::nullopt;
  return size * std::pow(fx2 * fy2, 0.25);
}

}  // namespace mvstudio::calib
