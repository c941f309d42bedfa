#include "calib/board/homography.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/QR>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

#include "core/check.h"
#include "core/statistics.h"

namespace mvstudio::calib {
namespace {

constexpr int kMaxDegree = 3;
constexpr int kRobustRounds = 8;
constexpr double kMadToSigma = 0.8493218;  // median of a 2-D Rayleigh distance to sigma per coordinate: 1 / sqrt(2 ln 2)

/// Similarity that moves the centroid to 0 and the mean distance to sqrt(2).
Eigen::Matrix3d Normalizer(const Eigen::Matrix2Xd& points) {
  const Eigen::Vector2d mean = points.rowwise().mean();
  const double distance = (points.colwise() - mean).colwise().norm().mean();
  const double scale = distance > 0 ? std::sqrt(2.0) / distance : 1;
  Eigen::Matrix3d t;
  t << scale, 0, -scale * mean.x(), 0, scale, -scale * mean.y(), 0, 0, 1;
  return t;
}

int NumTerms(int degree) { return (degree + 1) * (degree + 2) / 2; }

int DegreeFor(Eigen::Index num_points) {
  if (num_points >= 24) return kMaxDegree;
  return num_points >= 14 ? 2 : 0;
}

}  // namespace

double Median(Eigen::VectorXd values) { return values.size() == 0 ? 0 : UpperMedian(values.begin(), values.end()); }

std::optional<Eigen::Matrix3d> FitHomography(const Eigen::Matrix2Xd& from, const Eigen::Matrix2Xd& to,
                                             const Eigen::VectorXd& weights) {
  MVS_CHECK(from.cols() == to.cols(), from.cols() << " and " << to.cols() << " points");
  const Eigen::Index n = from.cols();
  if (n < 4 || !from.allFinite() || !to.allFinite()) return std::nullopt;
  const Eigen::Matrix3d normalize_from = Normalizer(from), normalize_to = Normalizer(to);
  Eigen::MatrixXd a = Eigen::MatrixXd::Zero(std::max<Eigen::Index>(2 * n, 9), 9);
  for (Eigen::Index i = 0; i < n; ++i) {
    const double w = weights.size() ? weights[i] : 1;
    const Eigen::RowVector3d p = w * (normalize_from * from.col(i).homogeneous()).transpose();
    const Eigen::Vector3d q = normalize_to * to.col(i).homogeneous();
    a.row(2 * i) << p, Eigen::RowVector3d::Zero(), -q.x() * p;
    a.row(2 * i + 1) << Eigen::RowVector3d::Zero(), p, -q.y() * p;
  }
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(a, Eigen::ComputeFullV);
  if (svd.singularValues()[7] < 1e-8 * svd.singularValues()[0]) return std::nullopt;
  const Eigen::VectorXd h = svd.matrixV().col(8);
  const Eigen::Matrix3d normalized = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(h.data());
  Eigen::Matrix3d homography = normalize_to.inverse() * normalized * normalize_from;
  if (!homography.allFinite() || homography.norm() == 0) return std::nullopt;
  if ((homography.row(2) * from.colwise().homogeneous()).sum() < 0) homography = -homography;
  return homography / homography.norm();
}

Eigen::Vector2d MapPoint(const Eigen::Matrix3d& homography, const Eigen::Vector2d& point) {
  return (homography * point.homogeneous()).hnormalized();
}

std::optional<PlaneToImage> PlaneToImage::Fit(const Eigen::Matrix2Xd& in_plane, const Eigen::Matrix2Xd& px) {
  PlaneToImage fit;
  Eigen::VectorXd weights = Eigen::VectorXd::Ones(px.cols());
  Eigen::VectorXd distances(px.cols());
  for (int round = 0; round < kRobustRounds; ++round) {
    const auto homography = FitHomography(in_plane, px, weights);
    if (!homography) return std::nullopt;
    fit.homography_ = *homography;
    for (Eigen::Index i = 0; i < px.cols(); ++i) distances[i] = (MapPoint(*homography, in_plane.col(i)) - px.col(i)).norm();
    const double scale = std::max(1e-9, 3 * Median(distances));
    weights = (1 + (distances / scale).array().square()).inverse();
  }
  fit.homography_median_px_ = Median(distances);
  fit.center_ = in_plane.rowwise().mean();
  fit.scale_ = 1 / std::max(1e-300, (in_plane.colwise() - fit.center_).cwiseAbs().maxCoeff());
  fit.degree_ = DegreeFor(px.cols());
  fit.FitPolynomial(in_plane, px);
  return fit;
}

Eigen::VectorXd PlaneToImage::Terms(const Eigen::Vector2d& in_plane) const {
  const Eigen::Vector2d p = (in_plane - center_) * scale_;
  Eigen::VectorXd terms(NumTerms(degree_));
  int k = 0;
  for (int i = 0; i <= degree_; ++i) {
    for (int j = 0; i + j <= degree_; ++j) terms[k++] = std::pow(p.x(), i) * std::pow(p.y(), j);
  }
  return terms;
}

void PlaneToImage::FitPolynomial(const Eigen::Matrix2Xd& in_plane, const Eigen::Matrix2Xd& px) {
  const Eigen::Index n = px.cols();
  Eigen::MatrixXd a(n, NumTerms(degree_)), b(n, 2);
  for (Eigen::Index i = 0; i < n; ++i) {
    a.row(i) = Terms(in_plane.col(i)).transpose();
    b.row(i) = (px.col(i) - MapPoint(homography_, in_plane.col(i))).transpose();
  }
  coefficients_ = Eigen::MatrixXd::Zero(a.cols(), 2);
  residuals_px_ = b.rowwise().norm();
  for (int round = 0; degree_ > 0 && round < kRobustRounds; ++round) {
    const double scale = std::max(1e-9, 3 * Median(residuals_px_));
    const Eigen::VectorXd w = (1 + (residuals_px_ / scale).array().square()).inverse();
    coefficients_ = (w.asDiagonal() * a).colPivHouseholderQr().solve(w.asDiagonal() * b);
    residuals_px_ = (b - a * coefficients_).rowwise().norm();
  }
  sigma_px_ = kMadToSigma * Median(residuals_px_);
}

Eigen::Vector2d PlaneToImage::operator()(const Eigen::Vector2d& in_plane) const {
  return MapPoint(homography_, in_plane) + coefficients_.transpose() * Terms(in_plane);
}

}  // namespace mvstudio::calib
