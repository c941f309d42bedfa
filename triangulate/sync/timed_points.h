// Private: unknowns and equations of RefineOffsets.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "triangulate/point/linear.h"

namespace mvstudio::triangulate::internal {

/// Unknowns of a camera: offset (frames), drift (frames at the take's end), shift of its image (px).
inline constexpr int kClockParams = 4, kClockShift = 2;

/// One camera's view of a point at the current offsets.
struct TimedView {
  View view;  // px: sampled minus the image's shift
  size_t camera_idx;
  Eigen::Vector2d px_per_frame;
  double weight = 1;
};

struct TimedPoint {
  int frame = 0;
  int index = 0;  // of the frame among those that are looked at
  double at = 0;  // -1 at the beginning of the take, 1 at its end
  size_t person_idx = 0, joint_idx = 0;
  int block = 0;
  std::vector<TimedView> views;
  Eigen::Vector3d x_in_local = Eigen::Vector3d::Zero();
};

struct TimedResidual {
  Eigen::Vector2d px;  // observed minus projected
  Eigen::Matrix<double, 2, 3> d_px_d_x;
};

std::optional<TimedResidual> Evaluate(const TimedView& seen, const Eigen::Vector3d& x_in_local);

/// A point's residuals and their derivatives, one entry a view; empty where one of them has none.
struct PointEquations {
  std::vector<Eigen::Vector2d> px;                               // observed minus projected
  std::vector<Eigen::Matrix<double, 2, kClockParams>> by_clock;  // of px, by the view's own camera
  std::vector<Eigen::Matrix<double, 2, 3>> by_x;                 // of px
  Eigen::Matrix3d x_covariance;                                  // (sum w by_x^T by_x)^-1
};
std::optional<PointEquations> EquationsOf(const TimedPoint& point);

}  // namespace mvstudio::triangulate::internal
