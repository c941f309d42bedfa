#include "calib/rig/bending.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "calib/bundle/bundle.h"

namespace mvstudio::calib {
namespace {

constexpr Eigen::Index kMinCorners = 12;
constexpr int kMinFrames = 6;

/// Derivatives (2, N) of every corner's residual with respect to one of the two warp coefficients.
std::vector<Eigen::Matrix2Xd> ByBend(const std::vector<View>& views, const RigState& state, int axis, double probe_m) {
  RigState bent = state;
  for (Eigen::Vector2d& warp : bent.board_warp_m) warp[axis] += probe_m;
  std::vector<Eigen::Matrix2Xd> after = BundleResiduals(views, bent);
  for (Eigen::Vector2d& warp : bent.board_warp_m) warp[axis] -= 2 * probe_m;
  const std::vector<Eigen::Matrix2Xd> before = BundleResiduals(views, bent);
  for (size_t v = 0; v < after.size(); ++v) after[v] = (after[v] - before[v]) / (2 * probe_m);
  return after;
}

/// Normal equations of a time step's two warp coefficients.
struct Normal {
  Eigen::Matrix2d h = Eigen::Matrix2d::Zero();
  Eigen::Vector2d g = Eigen::Vector2d::Zero();
};

void Add(const View& view, const RigState& state, const Eigen::Matrix2Xd& by_first, const Eigen::Matrix2Xd& by_second, Normal* sum) {
  if ((view.weights.array() > 0).count() < kMinCorners || !by_first.allFinite() || !by_second.allFinite()) return;
  const Eigen::Matrix3Xd corners = BentCorners(view, state);
  const auto linear = LinearizeView(view, state.cameras[view.camera_idx], CamFromBoard(view, state), false, &corners);
  if (!linear) return;
  Eigen::MatrixXd bends(2 * view.size(), 2);
  for (Eigen::Index i = 0; i < view.size(); ++i) {
    const double scale = std::sqrt(view.weights[i]);
    bends.block<2, 1>(2 * i, 0) = scale * by_first.col(i);
    bends.block<2, 1>(2 * i, 1) = scale * by_second.col(i);
  }
  const Eigen::Matrix<double, 6, 6> pose = linear->d_pose.transpose() * linear->d_pose;
  const Eigen::MatrixXd own = bends - linear->d_pose * pose.ldlt().solve(linear->d_pose.transpose() * bends);
  sum->h += own.transpose() * own;
  sum->g += own.transpose() * linear->residuals;
}

}  // namespace

BoardBending EstimateBending(const std::vector<View>& views, const RigState& state, double sigma_px) {
  BoardBending result;
  double extent = 0;
  for (const View& view : views)
    extent = std::max(extent, (view.x_in_board.rowwise().maxCoeff() - view.x_in_board.rowwise().minCoeff()).norm());
  if (!(extent > 0) || !(sigma_px > 0)) return result;
  constexpr double kProbe = 1e-4;  // of the board
  const auto first = ByBend(views, state, 0, kProbe * extent), second = ByBend(views, state, 1, kProbe * extent);
  std::map<std::pair<int, int>, Normal> of_board;
  for (size_t v = 0; v < views.size(); ++v) Add(views[v], state, first[v], second[v], &of_board[{views[v].frame, views[v].board}]);
  double squares = 0, squared_bends = 0, noise = 0;
  for (const auto& [where, normal] : of_board) {
    const Eigen::LDLT<Eigen::Matrix2d> solver(normal.h);
    if (solver.info() != Eigen::Success || !(solver.rcond() > 1e-9)) continue;
    const Eigen::Vector2d bend = solver.solve(normal.g);
    squares += bend.dot(normal.g) / (sigma_px * sigma_px);
    squared_bends += bend.squaredNorm();
    noise += sigma_px * sigma_px * solver.solve(Eigen::Matrix2d::Identity()).trace();
    ++result.num_frames;
  }
  if (result.num_frames < kMinFrames) return result;
  result.variance_ratio = squares / (2 * result.num_frames);
  result.sigmas = (result.variance_ratio - 1) * std::sqrt(static_cast<double>(result.num_frames));
  result.rms_m = std::sqrt(std::max(0.0, squared_bends - noise) / result.num_frames);
  return result;
}

}  // namespace mvstudio::calib
