#include "calib/bundle/view.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/check.h"
#include "geometry/lens/lens_derivatives.h"
#include "geometry/rigid/cross_matrix.h"

namespace mvstudio::calib {
namespace {

using geometry::Rigid3;

}  // namespace

Eigen::Matrix2Xd WarpBasis(const Eigen::Matrix3Xd& corners_in_board) {
  Eigen::Matrix2Xd basis = Eigen::Matrix2Xd::Zero(2, corners_in_board.cols());
  if (corners_in_board.cols() == 0) return basis;
  for (int axis = 0; axis < 2; ++axis) {
    const auto coordinates = corners_in_board.row(axis).array();
    const double middle = (coordinates.minCoeff() + coordinates.maxCoeff()) / 2;
    const double half = (coordinates.maxCoeff() - coordinates.minCoeff()) / 2;
    if (half > 0) basis.row(axis) = (1 - ((coordinates - middle) / half).square()).matrix();
  }
  return basis;
}

View MakeView(const std::vector<Board>& boards, const Detection& detection, const std::vector<int64_t>& frames) {
  MVS_CHECK(detection.points_px.cols() == detection.num_corners(), "points and corner ids differ in number");
  MVS_CHECK(detection.board_idx >= 0 && detection.board_idx < static_cast<int>(boards.size()), "board " << detection.board_idx);
  const auto frame = std::lower_bound(frames.begin(), frames.end(), detection.frame_idx);
  MVS_CHECK(frame != frames.end() && *frame == detection.frame_idx, "frame " << detection.frame_idx << " is not listed");
  const Board& board = boards[detection.board_idx];
  const Eigen::Matrix3Xd corners = CornersInBoard(board);
  const Eigen::Matrix2Xd basis = WarpBasis(corners);
  View view;
  view.camera_idx = detection.camera_idx;
  view.frame = static_cast<int>(frame - frames.begin());
  view.board = detection.board_idx;
  view.corner_ids = detection.corner_ids;
  view.x_in_board.resize(3, detection.num_corners());
  view.warp_basis.resize(2, detection.num_corners());
  for (int i = 0; i < detection.num_corners(); ++i) {
    const int id = detection.corner_ids[i];
    MVS_CHECK(id >= 0 && id < board.num_corners(), "corner " << id << " is not on the board");
    view.x_in_board.col(i) = corners.col(id);
    view.warp_basis.col(i) = basis.col(id);
  }
  view.px = detection.points_px;
  const bool each = detection.sigmas_px.size() == detection.points_px.cols();
  view.weights = each ? Eigen::VectorXd(detection.sigmas_px.array().square().inverse())
                      : Eigen::VectorXd::Constant(detection.num_corners(), 1 / (detection.sigma_px * detection.sigma_px));
  return view;
}

std::vector<View> MakeViews(const std::vector<Board>& boards, const std::vector<Detection>& detections,
                            std::vector<int64_t>* frames) {
  frames->clear();
  for (const Detection& detection : detections) frames->push_back(detection.frame_idx);
  std::sort(frames->begin(), frames->end());
  frames->erase(std::unique(frames->begin(), frames->end()), frames->end());
  std::vector<View> views;
  for (const Detection& detection : detections) views.push_back(MakeView(boards, detection, *frames));
  return views;
}

View HalfOf(const View& view, int first) {
  View half = view;
  Eigen::Index n = 0;
  for (Eigen::Index i = first; i < view.size(); i += 2, ++n) {
    half.corner_ids[n] = view.corner_ids[i];
    half.x_in_board.col(n) = view.x_in_board.col(i);
    half.px.col(n) = view.px.col(i);
    half.weights[n] = view.weights[i];
    half.warp_basis.col(n) = view.warp_basis.col(i);
  }
  half.corner_ids.resize(n);
  half.x_in_board.conservativeResize(3, n);
  half.px.conservativeResize(2, n);
  half.weights.conservativeResize(n);
  half.warp_basis.conservativeResize(2, n);
  return half;
}

namespace {

Rigid3 MovedBoard(int camera_idx, int frame, const RigState& state) {
  const Rigid3& world_from_board = state.world_from_board[frame];
  if (state.time_offset_frames.empty()) return world_from_board;
  return geometry::Perturb(BoardStep(frame, LateFrames(camera_idx, frame, state), state), world_from_board);
}

}  // namespace

double LateFrames(int camera_idx, int frame, const RigState& state) {
  const auto c = static_cast<size_t>(camera_idx);
  if (state.time_offset_frames.empty()) return 0;
  const double since = static_cast<double>(state.frames[static_cast<size_t>(frame)]) - state.clock_frame;
  return state.time_offset_frames[c] + (state.time_rate.empty() ? 0 : state.time_rate[c] * since);
}

geometry::Vector6d BoardStep(int frame, double late_frames, const RigState& state) {
  geometry::Vector6d step = late_frames * state.board_velocity[frame];
  if (!state.board_acceleration.empty()) step += late_frames * late_frames / 2 * state.board_acceleration[frame];
  return step;
}

Eigen::MatrixXd BoardStepByTime(int camera_idx, int frame, const RigState& state, int num_time) {
  Eigen::MatrixXd derivative(6, num_time);
  derivative.col(0) = state.board_velocity[frame];
  if (!state.board_acceleration.empty())
    derivative.col(0) += LateFrames(camera_idx, frame, state) * state.board_acceleration[frame];
  if (num_time > 1) derivative.col(1) = (static_cast<double>(state.frames[frame]) - state.clock_frame) * derivative.col(0);
  return derivative;
}

Rigid3 BoardMotion(int camera_idx, int frame, const RigState& state) {
  if (state.time_offset_frames.empty()) return {};
  return MovedBoard(camera_idx, frame, state) * geometry::Inverse(state.world_from_board[frame]);
}

Rigid3 CamFromBoard(const View& view, const RigState& state) {
  return state.cam_from_world[view.camera_idx] *
         (MovedBoard(view.camera_idx, view.frame, state) * state.rig_from_board[view.board]);
}

Eigen::Matrix3Xd BentCorners(const View& view, const RigState& state) {
  Eigen::Matrix3Xd corners = view.x_in_board;
  corners.row(2) += state.board_warp_m[view.board].transpose() * view.warp_basis;
  if (state.board_stretch.empty()) return corners;
  const double shear = state.board_stretch[view.board].x(), aspect = state.board_stretch[view.board].y();
  corners.row(0) += aspect * view.x_in_board.row(0) + shear * view.x_in_board.row(1);
  corners.row(1) += shear * view.x_in_board.row(0) - aspect * view.x_in_board.row(1);
  return corners;
}

std::optional<ViewLinearization> LinearizeView(const View& view, const geometry::Camera& camera, const Rigid3& cam_from_board,
                                               bool with_lens, const Eigen::Matrix3Xd* corners) {
  const Eigen::Index n = view.size();
  const Eigen::Matrix3d rotation = cam_from_board.rotation.toRotationMatrix();
  ViewLinearization out;
  out.residuals.setZero(2 * n);
  out.d_pose.setZero(2 * n, 6);
  if (with_lens) out.d_lens.setZero(2 * n, camera.params.size());
  geometry::LensDerivatives d;
  for (Eigen::Index i = 0; i < n; ++i) {
    if (view.weights[i] <= 0) continue;
    const Eigen::Vector3d rotated = rotation * (corners ? corners->col(i) : view.x_in_board.col(i));
    Eigen::Vector2d px;
    if (!geometry::ProjectLens(camera, rotated + cam_from_board.translation, &px, &d)) return std::nullopt;
    const double scale = std::sqrt(view.weights[i]);
    out.residuals.segment<2>(2 * i) = scale * (px - view.px.col(i));
    out.d_pose.block<2, 3>(2 * i, 0) = -scale * d.d_px_d_x_in_cam * geometry::CrossMatrix(rotated);
    out.d_pose.block<2, 3>(2 * i, 3) = scale * d.d_px_d_x_in_cam;
    for (int k = 0; with_lens && k < d.count; ++k) out.d_lens.block<2, 1>(2 * i, d.columns[k]) = scale * d.d_px.col(k);
  }
  return out;
}

std::optional<Eigen::Matrix2Xd> ResidualsOf(const View& view, const geometry::Camera& camera, const Rigid3& cam_from_board,
                                            const Eigen::Matrix3Xd* corners) {
  Eigen::Matrix2Xd residuals(2, view.size());
  for (Eigen::Index i = 0; i < view.size(); ++i) {
    const Eigen::Vector3d x = corners ? corners->col(i) : view.x_in_board.col(i);
    Eigen::Vector2d px;
    if (geometry::ProjectLens(camera, cam_from_board * x, &px, nullptr)) {
      residuals.col(i) = px - view.px.col(i);
    } else if (view.weights[i] > 0) {
      return std::nullopt;
    } else {
      residuals.col(i).setConstant(std::numeric_limits<double>::infinity());
    }
  }
  return residuals;
}

}  // namespace mvstudio::calib
