#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "calib/board/board.h"
#include "calib/board/detection.h"
#include "geometry/lens/camera.h"
#include "geometry/rigid/rigid3.h"

namespace mvstudio::calib {

/// The observation of one board in one image, as the estimators use it.
struct View {
  int camera_idx = 0;
  int frame = 0;                ///< index into RigState::frames
  int board = 0;                ///< index into RigState::rig_from_board
  std::vector<int> corner_ids;  // (N)
  Eigen::Matrix3Xd x_in_board;  // (3, N) metres
  Eigen::Matrix2Xd px;          // (2, N)
  Eigen::Matrix2Xd warp_basis;  // (2, N) of WarpBasis at the corners
  Eigen::VectorXd weights;      // (N) of the squared residual; 0 for rejected corners

  Eigen::Index size() const { return px.cols(); }
};

/// Which observed frames say how the boards move in a frame (EstimateMotion).
struct MotionModel {
  int64_t reach = 2;   ///< frames: those farther away say nothing
  int neighbours = 1;  ///< on either side
  int64_t gap = 1;     ///< frames from one to the next, at least: far ones tell a motion of noisy poses better
};

/// All unknowns of the bundle adjustment.
struct RigState {
  std::vector<geometry::Camera> cameras;
  std::vector<geometry::Rigid3> cam_from_world;                           // per camera
  std::vector<int64_t> frames;                                            // frame_idx, ascending
  std::vector<geometry::Rigid3> world_from_board;                         // per frame: pose of the first board
  std::vector<geometry::Rigid3> rig_from_board = {geometry::Rigid3()};    // per board: first board from it; boards are rigid
  std::vector<Eigen::Vector2d> board_warp_m = {Eigen::Vector2d::Zero()};  // per board, see WarpBasis
  std::vector<Eigen::Vector2d> board_stretch;  // per board: shear s and aspect a, x' = (1 + a) x + s y, y' = s x + (1 - a) y;
                                               // empty: none
  std::vector<double> time_offset_frames;      // per camera: its capture time minus that of the frame; empty: none
  std::vector<double> time_rate;               // per camera: what that grows by in a frame, from clock_frame on; empty: none
  double clock_frame = 0;                      // frame_idx at which time_offset_frames holds
  MotionModel motion;                          // how the boards' motion is told from their poses
  std::vector<geometry::Vector6d> board_velocity;      // per frame, needed with time offsets: perturbation per frame
  std::vector<geometry::Vector6d> board_acceleration;  // per frame: perturbation per frame^2; empty: none
  std::vector<int> lens_group;  // per camera: cameras of one group share all parameters; empty: each its own
};

/// Out-of-plane displacement of a board's corners (3, N) for a warp of 1 m along x (first row) and along y, (2, N). A
/// parabola that is 1 in the middle and 0 at the outer corners, as in mrcal.
Eigen::Matrix2Xd WarpBasis(const Eigen::Matrix3Xd& corners_in_board);

/// View of a detection on `boards[detection.board_idx]`; `frames` must hold its frame_idx.
View MakeView(const std::vector<Board>& boards, const Detection& detection, const std::vector<int64_t>& frames);

/// Views of all detections and the sorted list of their frames.
std::vector<View> MakeViews(const std::vector<Board>& boards, const std::vector<Detection>& detections,
                            std::vector<int64_t>* frames);

/// Every second corner of a view, from `first` (0 or 1).
View HalfOf(const View& view, int first);

/// Capture time of a camera minus that of the frame, frames: RigState::time_offset_frames with the drift of its clock. `frame`
/// is an index into RigState::frames.
double LateFrames(int camera_idx, int frame, const RigState& state);

/// Left perturbation of the boards from the time of a frame to `late_frames` later, by their velocity and acceleration.
geometry::Vector6d BoardStep(int frame, double late_frames, const RigState& state);

/// Derivatives of BoardStep by the camera's time offset and, with `num_time` 2, by its rate: (6, num_time).
Eigen::MatrixXd BoardStepByTime(int camera_idx, int frame, const RigState& state, int num_time);

/// Motion of the boards, in world, from the time of a frame to the time at which the camera took its image
/// (RigState::time_offset_frames). Identity without time offsets.
geometry::Rigid3 BoardMotion(int camera_idx, int frame, const RigState& state);

/// Pose of the view's board in its camera: cam_from_world * BoardMotion * world_from_board * rig_from_board.
geometry::Rigid3 CamFromBoard(const View& view, const RigState& state);

/// Corners (3, N) of the view on the warped and stretched board, metres.
Eigen::Matrix3Xd BentCorners(const View& view, const RigState& state);

/// Residuals (projected minus observed, px) and their derivatives with respect to the camera's parameters and to a left
/// perturbation (rotation, translation) of cam_from_board.
struct ViewLinearization {
  Eigen::VectorXd residuals;                        // (2 N)
  Eigen::MatrixXd d_lens;                           // (2 N, P), empty without `with_lens`
  Eigen::Matrix<double, Eigen::Dynamic, 6> d_pose;  // (2 N, 6)
};

/// Empty when a corner with a weight cannot be projected. Rows are multiplied by sqrt(weights). `corners` as from
/// BentCorners; null: the flat ones of the view.
std::optional<ViewLinearization> LinearizeView(const View& view, const geometry::Camera& camera,
                                               const geometry::Rigid3& cam_from_board, bool with_lens = true,
                                               const Eigen::Matrix3Xd* corners = nullptr);

/// Unweighted residuals (2, N), px, projected minus observed. Empty when a corner with a weight cannot be projected;
/// infinite for other corners that cannot.
std::optional<Eigen::Matrix2Xd> ResidualsOf(const View& view, const geometry::Camera& camera,
                                            const geometry::Rigid3& cam_from_board, const Eigen::Matrix3Xd* corners = nullptr);

}  // namespace mvstudio::calib
