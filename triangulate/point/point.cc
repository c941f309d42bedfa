#include "triangulate/point/point.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "core/check.h"
#include "triangulate/point/robust.h"

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
  point.used.reserve(fit.views.size());
  double sum = 0;
  for (const View& view : fit.views) {
    point.used.push_back(view.observation_idx);
    const double residual_px = WhitenedResidual(view, fit.at.x_in_local) * view.sigma_px;
    sum += residual_px * residual_px;
  }
  point.rms_px = std::sqrt(sum / static_cast<double>(fit.views.size()));
  return point;
}

constexpr std::string_view kMethodNames[] = {"robust", "all-views", "linear", "midpoint", "dlt", "least-squares",
                                             "lost",   "mid2",      "wmid2",  "l1",       "linf"};

}  // namespace

std::string_view ToString(PointMethod method) { return kMethodNames[static_cast<int>(method)]; }

std::optional<PointMethod> PointMethodFromString(std::string_view name) {
  if (name == "auto") return PointMethod::kRobust;
  for (const PointMethod method : kAllPointMethods) {
    if (ToString(method) == name) return method;
  }
  return std::nullopt;
}

Point TriangulateViews(const PreparedRig& rig, const std::vector<View>& views, size_t num_observations, Status rejected,
                       const PointOptions& options) {
  const size_t min_views = static_cast<size_t>(std::max(options.min_views, 2));
  if (views.size() < min_views) {
    Point point;
    point.num_observations = static_cast<int>(num_observations);
    if (num_observations >= min_views) point.status = rejected != Status::kOk ? rejected : Status::kDegenerate;
    return point;
  }
  const bool select = options.method == PointMethod::kRobust || options.select_views;
  return ToPoint(rig, select ? FitConsistent(views, options) : FitViews(views, options), num_observations);
}

Point TriangulatePoint(const PreparedRig& rig, const std::vector<Observation>& observations, const PointOptions& options) {
  CheckOneAPerCamera(rig, observations);
  Status rejected = Status::kOk;
  const std::vector<View> views = MakeViews(rig, observations, &rejected);
  return TriangulateViews(rig, views, observations.size(), rejected, options);
}

}  // namespace mvstudio::triangulate
