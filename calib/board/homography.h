#pragma once

#include <Eigen/Core>
#include <optional>

namespace mvstudio::calib {

/// Homography from points (2, N) `from` to `to`: weighted least squares of the algebraic error in normalised coordinates
/// (Hartley, "In defense of the eight-point algorithm", PAMI 1997). Empty for fewer than 4 points or degenerate ones.
std::optional<Eigen::Matrix3d> FitHomography(const Eigen::Matrix2Xd& from, const Eigen::Matrix2Xd& to,
                                             const Eigen::VectorXd& weights = {});

Eigen::Vector2d MapPoint(const Eigen::Matrix3d& homography, const Eigen::Vector2d& point);

/// Smooth model of a plane's image through a lens: a homography plus a polynomial of the plane's coordinates. The
/// polynomial has the highest degree, at most 3, that the points allow; the fit uses robust weights.
class PlaneToImage {
 public:
  /// Points (2, N) in the plane and in the image. Empty when no homography fits.
  static std::optional<PlaneToImage> Fit(const Eigen::Matrix2Xd& in_plane, const Eigen::Matrix2Xd& px);

  Eigen::Vector2d operator()(const Eigen::Vector2d& in_plane) const;
  /// Distances (N) of the points from the model, px.
  const Eigen::VectorXd& residuals_px() const { return residuals_px_; }
  /// Median distance of the fitted points from the homography alone, px.
  double homography_median_px() const { return homography_median_px_; }
  /// Robust standard deviation per coordinate of the residuals, px.
  double sigma_px() const { return sigma_px_; }

 private:
  Eigen::VectorXd Terms(const Eigen::Vector2d& in_plane) const;
  void FitPolynomial(const Eigen::Matrix2Xd& in_plane, const Eigen::Matrix2Xd& px);

  Eigen::Matrix3d homography_;
  Eigen::Vector2d center_;
  double scale_ = 1;
  int degree_ = 0;
  Eigen::MatrixXd coefficients_;  // (terms, 2)
  Eigen::VectorXd residuals_px_;
  double homography_median_px_ = 0, sigma_px_ = 0;
};

double Median(Eigen::VectorXd values);

}  // namespace mvstudio::calib
