#include "triangulate/sync/timed_points.h"

#include <Eigen/LU>

namespace mvstudio::triangulate::internal {

std::optional<TimedResidual> Evaluate(const TimedView& seen, const Eigen::Vector3d& x_in_local) {
  const auto at = seen.view.camera->projector.ProjectWithJacobians(seen.view.camera->ToCam(x_in_local));
  if (at.status != Status::kOk) return std::nullopt;
  return TimedResidual{seen.view.px - at.px, at.d_px_d_x * seen.view.camera->cam_from_local_rotation};
}

std::optional<PointEquations> EquationsOf(const TimedPoint& point) {
  PointEquations equations;
  Eigen::Matrix3d xx = Eigen::Matrix3d::Zero();
  for (const TimedView& seen : point.views) {
    const auto residual = Evaluate(seen, point.x_in_local);
    if (!residual) return std::nullopt;
    const Eigen::Matrix<double, 2, 3> by_x = -residual->d_px_d_x;
    Eigen::Matrix<double, 2, kClockParams> by_clock;
    by_clock << seen.px_per_frame, point.at * seen.px_per_frame, -Eigen::Matrix2d::Identity();
    equations.px.push_back(residual->px);
    equations.by_x.push_back(by_x), equations.by_clock.push_back(by_clock);
    xx += seen.weight * by_x.transpose() * by_x;
  }
  equations.x_covariance = xx.inverse();
  return equations;
}

}  // namespace mvstudio::triangulate::internal
