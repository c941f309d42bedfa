#include "triangulate/point/exhaustive_dlt.h"

#include <Eigen/Dense>
#include <cmath>
#include <limits>

#include "core/check.h"

namespace mvstudio::triangulate {
namespace {

struct PixelView {
  Eigen::Matrix<double, 3, 4> px_from_world;
  Eigen::Vector2d px;
  double score;
  int observation_idx;
};

struct SubsetPoint {
  Eigen::Vector3d x_in_world = Eigen::Vector3d::Zero();
  double mean_error_px = std::numeric_limits<double>::infinity();
  unsigned mask = 0;
};

std::vector<PixelView> MakePixelViews(const geometry::Rig& rig, const std::vector<Observation>& observations,
                                      double min_score) {
  std::vector<PixelView> views;
  for (size_t i = 0; i < observations.size(); ++i) {
    const Observation& seen = observations[i];
    if (!(seen.score >= min_score) || !seen.px.allFinite()) continue;
    const geometry::RigCamera& camera = rig.cameras[seen.camera_idx];
    const Eigen::Matrix4d cam_from_world = geometry::ToMatrix(camera.cam_from_world);
    views.push_back({camera.camera.K() * cam_from_world.topRows<3>(), seen.px, seen.score, static_cast<int>(i)});
  }
  return views;
}

double ErrorPx(const PixelView& view, const Eigen::Vector3d& x_in_world) {
  return ((view.px_from_world * x_in_world.homogeneous()).hnormalized() - view.px).norm();
}

SubsetPoint Solve(const std::vector<PixelView>& views, unsigned mask) {
  Eigen::Matrix<double, Eigen::Dynamic, 4> a(2 * __builtin_popcount(mask), 4);
  Eigen::Index row = 0;
  for (size_t i = 0; i < views.size(); ++i) {
    if (!(mask >> i & 1u)) continue;
    const PixelView& view = views[i];
    for (int k = 0; k < 2; ++k) {
      a.row(row++) = (view.px_from_world.row(k) - view.px[k] * view.px_from_world.row(2)) * view.score;
    }
  }
  const Eigen::Vector4d null = Eigen::JacobiSVD<Eigen::MatrixXd>(a, Eigen::ComputeFullV).matrixV().col(3);
  SubsetPoint candidate{null.hnormalized(), 0, mask};
  for (size_t i = 0; i < views.size(); ++i) {
    if (mask >> i & 1u) candidate.mean_error_px += ErrorPx(views[i], candidate.x_in_world) / __builtin_popcount(mask);
  }
  if (!std::isfinite(candidate.mean_error_px)) candidate.mean_error_px = std::numeric_limits<double>::infinity();
  return candidate;
}

SubsetPoint Search(const std::vector<PixelView>& views, const ExhaustiveDltOptions& options) {
  const int n = static_cast<int>(views.size());
  SubsetPoint best;
  for (int excluded = 0; excluded <= options.max_excluded_views && n - excluded >= 2; ++excluded) {
    for (unsigned mask = 1; mask < 1u << n; ++mask) {
      if (__builtin_popcount(mask) != n - excluded) continue;
      const SubsetPoint candidate = Solve(views, mask);
      if (candidate.mean_error_px < best.mean_error_px) best = candidate;
    }
    if (best.mean_error_px <= options.max_error_px) break;
  }
  return best;
}

}  // namespace

Point TriangulateExhaustiveDlt(const geometry::Rig& rig, const std::vector<Observation>& observations,
                               const ExhaustiveDltOptions& options) {
  constexpr size_t kMaxViews = 20;
  MVS_CHECK(observations.size() <= kMaxViews, observations.size()
                                                  << " views: the exhaustive search takes at most " << kMaxViews);
  const std::vector<PixelView> views = MakePixelViews(rig, observations, options.min_score);
  Point point;
  point.num_observations = static_cast<int>(observations.size());
  if (views.size() < 2) return point;
  const SubsetPoint best = Search(views, options);
  if (!(best.mean_error_px <= options.max_error_px)) {
    point.status = Status::kOutlier;
    return point;
  }
  point.status = Status::kOk;
  point.x_in_world = best.x_in_world;
  double sum = 0;
  for (size_t i = 0; i < views.size(); ++i) {
    if (!(best.mask >> i & 1u)) continue;
    point.used.push_back(views[i].observation_idx);
    sum += std::pow(ErrorPx(views[i], best.x_in_world), 2);
  }
  point.rms_px = std::sqrt(sum / static_cast<double>(point.used.size()));
  return point;
}

}  // namespace mvstudio::triangulate
