#include "calib/rig/readout.h"

#include <Eigen/Cholesky>
#include <cmath>
#include <optional>

#include "calib/bundle/bundle.h"

namespace mvstudio::calib {
namespace {

constexpr double kProbe = 0.25;  // frames, for the derivative by time

/// Motion of every corner in the image, px per frame: minus the derivative of its residual with respect to the time of the
/// image.
std::vector<Eigen::Matrix2Xd> CornerVelocities(const std::vector<View>& views, RigState state) {
  const std::vector<double> offsets =
      state.time_offset_frames.empty() ? std::vector<double>(state.cameras.size(), 0) : state.time_offset_frames;
  const auto residuals_at = [&](double step) {
    state.time_offset_frames = offsets;
    for (double& offset : state.time_offset_frames) offset += step;
    return BundleResiduals(views, state);
  };
  std::vector<Eigen::Matrix2Xd> later = residuals_at(kProbe);
  const std::vector<Eigen::Matrix2Xd> earlier = residuals_at(-kProbe);
  for (size_t v = 0; v < later.size(); ++v) later[v] = (later[v] - earlier[v]) / (2 * kProbe);
  return later;
}

/// A vector less its part in the span of the pose's derivatives.
Eigen::VectorXd WithoutPose(const Eigen::Matrix<double, Eigen::Dynamic, 6>& d_pose, const Eigen::VectorXd& x) {
  const Eigen::Matrix<double, 6, 6> normal = d_pose.transpose() * d_pose;
  return x - d_pose * normal.ldlt().solve(d_pose.transpose() * x);
}

struct Sums {
  double product = 0, square = 0, moved = 0;
  int corners = 0;
};

/// A view's share in the estimate.
void Add(const View& view, const RigState& state, const Eigen::Matrix2Xd& velocity, Sums* sums) {
  const geometry::Camera& camera = state.cameras[view.camera_idx];
  const Eigen::Matrix3Xd corners = BentCorners(view, state);
  const auto linear = LinearizeView(view, camera, CamFromBoard(view, state), false, &corners);
  if (!linear || !velocity.allFinite() || (view.weights.array() > 0).count() < 6) return;
  Eigen::VectorXd shift(2 * view.size());
  for (Eigen::Index i = 0; i < view.size(); ++i) {
    const double row = view.px(1, i) / std::max(1, camera.height_px - 1) - 0.5;
    shift.segment<2>(2 * i) = -std::sqrt(view.weights[i]) * row * velocity.col(i);
    if (view.weights[i] > 0) sums->moved += row * row * velocity.col(i).squaredNorm(), ++sums->corners;
  }
  const Eigen::VectorXd own = WithoutPose(linear->d_pose, shift);
  sums->product += own.dot(linear->residuals);
  sums->square += own.squaredNorm();
}

}  // namespace

std::vector<Readout> EstimateReadout(const std::vector<View>& views, const RigState& state, double sigma_px) {
  RigState moving = state;
  EstimateMotion(views, &moving);
  const std::vector<Eigen::Matrix2Xd> velocities = CornerVelocities(views, moving);
  std::vector<Sums> sums(state.cameras.size());
  for (size_t v = 0; v < views.size(); ++v) Add(views[v], state, velocities[v], &sums[views[v].camera_idx]);
  std::vector<Readout> readouts(state.cameras.size());
  for (size_t c = 0; c < readouts.size(); ++c) {
    if (!(sums[c].square > 0) || sums[c].corners == 0) continue;
    readouts[c].frames = sums[c].product / sums[c].square;
    readouts[c].sigma_frames = sigma_px / std::sqrt(sums[c].square);
    readouts[c].shift_px = std::abs(readouts[c].frames) * std::sqrt(sums[c].moved / sums[c].corners);
  }
  return readouts;
}

}  // namespace mvstudio::calib
