#include "triangulate/point/linear.h"

#include <Eigen/Geometry>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>

namespace mvstudio::triangulate {
namespace {

constexpr double kRankTolerance = 1e-13;

/// Two rows `w u . x = w u . c` a ray, u perpendicular to it: never the normal equations, whose condition is the square.
LinearPoint SolveRays(const std::vector<View>& views, const std::vector<double>& weights) {
  const Eigen::Index n = static_cast<Eigen::Index>(views.size());
  if (n < 2) return {Status::kTooFewViews, Eigen::Vector3d::Zero()};
  Eigen::Matrix<double, Eigen::Dynamic, 3> a(2 * n, 3);
  Eigen::VectorXd b(2 * n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const View& view = views[i];
    const Eigen::Vector3d u = view.ray_in_local.unitOrthogonal();
    const Eigen::Vector3d v = view.ray_in_local.cross(u);
    a.row(2 * i) = weights[i] * u;
    a.row(2 * i + 1) = weights[i] * v;
    b.segment<2>(2 * i) = a.middleRows<2>(2 * i) * view.camera->center_in_local;
  }
  Eigen::ColPivHouseholderQR<Eigen::Matrix<double, Eigen::Dynamic, 3>> qr;
  qr.setThreshold(kRankTolerance);
  qr.compute(a);
  if (qr.rank() < 3) return {Status::kDegenerate, Eigen::Vector3d::Zero()};
  return {Status::kOk, qr.solve(b)};
}

}  // namespace

LinearPoint Midpoint(const std::vector<View>& views) { return SolveRays(views, std::vector<double>(views.size(), 1.0)); }

LinearPoint WeightedLinear(const std::vector<View>& views) {
  std::vector<double> weights(views.size());
  const double sigma = views.empty() ? 1.0 : views.front().sigma_rad;
  for (size_t i = 0; i < views.size(); ++i) weights[i] = sigma / views[i].sigma_rad;
  LinearPoint point = SolveRays(views, weights);
  if (point.status != Status::kOk) return point;
  std::vector<double> distances(views.size());
  double nearest = std::numeric_limits<double>::infinity();
  for (size_t i = 0; i < views.size(); ++i) {
    distances[i] = (point.x_in_local - views[i].camera->center_in_local).norm();
    nearest = std::min(nearest, distances[i]);
  }
  if (!(nearest > 0) || !std::isfinite(nearest)) return point;
  for (size_t i = 0; i < views.size(); ++i) weights[i] *= nearest / distances[i];
  const LinearPoint weighted = SolveRays(views, weights);
  return weighted.status == Status::kOk ? weighted : point;
}

double ParallaxSignificance(const View& a, const View& b) {
  const double variance = a.sigma_rad * a.sigma_rad + b.sigma_rad * b.sigma_rad;
  return a.ray_in_local.cross(b.ray_in_local).norm() / std::sqrt(variance);
}

double ParallaxSignificance(const std::vector<View>& views) {
  double best = 0;
  for (size_t i = 0; i < views.size(); ++i) {
    for (size_t j = i + 1; j < views.size(); ++j) best = std::max(best, ParallaxSignificance(views[i], views[j]));
  }
  return best;
}

}  // namespace mvstudio::triangulate
