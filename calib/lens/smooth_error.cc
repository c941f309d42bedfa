#include "calib/lens/smooth_error.h"

#include <Eigen/QR>
#include <cmath>
#include <limits>

namespace mvstudio::calib {
namespace {

constexpr Eigen::Index kMinCorners = 24;
constexpr int kDegree = 3, kNumTerms = 10;

/// The corners with a weight.
std::vector<Eigen::Index> Kept(const View& view) {
  std::vector<Eigen::Index> kept;
  for (Eigen::Index i = 0; i < view.size(); ++i) {
    if (view.weights[i] > 0) kept.push_back(i);
  }
  return kept;
}

/// Terms (N, kNumTerms) of places (2, N), which are scaled to -1 … 1.
Eigen::MatrixXd TermsOf(const Eigen::Matrix2Xd& places) {
  const Eigen::Matrix2Xd centred = places.colwise() - places.rowwise().mean();
  const Eigen::Matrix2Xd at = centred / std::max(1e-300, centred.cwiseAbs().maxCoeff());
  Eigen::MatrixXd terms(places.cols(), kNumTerms);
  int k = 0;
  for (int i = 0; i <= kDegree; ++i) {
    for (int j = 0; i + j <= kDegree; ++j, ++k)
      terms.col(k) = (at.row(0).array().pow(i) * at.row(1).array().pow(j)).transpose();
  }
  return terms;
}

}  // namespace

double SmoothErrorPx(const std::vector<View>& views, const std::vector<Eigen::Matrix2Xd>& residuals_px, int camera_idx) {
  double sum = 0, count = 0;
  for (size_t v = 0; v < views.size(); ++v) {
    const std::vector<Eigen::Index> kept = views[v].camera_idx == camera_idx ? Kept(views[v]) : std::vector<Eigen::Index>();
    const auto n = static_cast<Eigen::Index>(kept.size());
    if (n < kMinCorners) continue;
    const Eigen::MatrixXd terms = TermsOf(views[v].x_in_board.topRows<2>()(Eigen::all, kept));
    const Eigen::MatrixXd residuals = residuals_px[v](Eigen::all, kept).transpose();
    const Eigen::MatrixXd rest = residuals - terms * terms.colPivHouseholderQr().solve(residuals);
    const auto corners = static_cast<double>(n);
    sum += rest.squaredNorm() * corners / (corners - kNumTerms);
    count += corners;
  }
  return count > 0 ? std::sqrt(sum / count) : std::numeric_limits<double>::quiet_NaN();
}

}  // namespace mvstudio::calib
