#include "triangulate/point.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "core/check.h"
#include "triangulate/robust.h"

namespace mvstudio::triangulate {
namespace {

void CheckOneAPerCamera(const PreparedRig& rig, const std::vector<Observation>& observations) {
  std::vector<bool> seen(rig.cameras.size(), false);
  for (const Observation& observation : observations) {
    const size_t camera = static_cast<size_t>(observation.camera_idx);
    MVS_CHECK(camera < seen.size() && !seen[camera],
              "camera " << observation.camera_idx << " is unknown or observes the point twice");
    seen[camera] = true;
  }
}

Point ToPoint(const PreparedRig& rig, const Fit& fit, size_t num_observations) {
  Point point;
  point.num_observations = static_cast<int>(num_observations);
  point.status = fit.status;
  if (fit.status != Status::kOk) return point;
  point.x_in_world = rig.origin_in_world + fit.at.x_in_local;
  point.covariance = fit.at.information.inverse();
  point.chi_squared = fit.at.chi_squared;
  double sum = 0;
  for (const View& view : fit.views) {
    point.used.push_back(view.observation_idx);
    const double residual_px = WhitenedResidual(view, fit.at.x_in_local) * view.sigma_px;
    sum += residual_px * residual_px;
  }
  point.rms_px = std::sqrt(sum / static_cast<double>(fit.views.size()));
  return point;
}

}  // namespace

Point TriangulatePoint(const PreparedRig& rig, const std::vector<Observation>& observations, const PointOptions& options) {
  CheckOneAPerCamera(rig, observations);
  Status rejected = Status::kOk;
  const std::vector<View> views = MakeViews(rig, observations, &rejected);
  const size_t min_views = static_cast<size_t>(std::max(options.min_views, 2));
  if (views.size() < min_views) {
    Point point;
    point.num_observations = static_cast<int>(observations.size());
    point.status = rejected != Status::kOk && observations.size() >= min_views ? rejected : Status::kTooFewViews;
    return point;
  }
  const Fit all = FitViews(views, options);
  const bool consistent = all.status == Status::kOk && all.worst_sigmas <= options.max_residual_sigmas;
  if (consistent || options.method != PointMethod::kRobust) return ToPoint(rig, all, observations.size());
  return ToPoint(rig, SelectConsistent(views, all, options), observations.size());
}

}  // namespace mvstudio::triangulate
