#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "calib/board.h"
#include "calib/detection.h"
#include "geometry/camera.h"
#include "geometry/rigid3.h"

namespace mvstudio::calib {

/// One board in one image, as the estimators use it.
struct View {
  int camera_idx = 0;
  int frame = 0;                ///< index into RigState::frames
  std::vector<int> corner_ids;  // (N)
  Eigen::Matrix3Xd x_in_board;  // (3, N) metres
  Eigen::Matrix2Xd px;          // (2, N)
  Eigen::VectorXd weights;      // (N) of the squared residual; 0 for rejected corners

  Eigen::Index size() const { return px.cols(); }
};

/// Everything the bundle adjustment estimates.
struct RigState {
  std::vector<geometry::Camera> cameras;
  std::vector<geometry::Rigid3> cam_from_world;    // per camera
  std::vector<int64_t> frames;                     // frame_idx, ascending
  std::vector<geometry::Rigid3> world_from_board;  // per frame
};

/// View of a detection; `frames` must hold its frame_idx.
View MakeView(const Board& board, const Detection& detection, const std::vector<int64_t>& frames);

/// Views of all detections and the sorted list of their frames.
std::vector<View> MakeViews(const Board& board, const std::vector<Detection>& detections, std::vector<int64_t>* frames);

/// Every second corner of a view, from `first` (0 or 1).
View HalfOf(const View& view, int first);

/// Residuals (projection minus observation, px) and their derivatives with respect to the camera's parameters and to left
/// perturbations (rotation, translation) of cam_from_world and world_from_board.
struct ViewLinearization {
  Eigen::VectorXd residuals;  // (2 N)
  Eigen::MatrixXd d_params;   // (2 N, P)
  Eigen::MatrixXd d_cam;      // (2 N, 6)
  Eigen::MatrixXd d_board;    // (2 N, 6)
};

/// Nothing when a corner with a weight cannot be projected. With `weighted`, rows are multiplied by sqrt(weights).
std::optional<ViewLinearization> LinearizeView(const View& view, const geometry::Camera& camera,
                                               const geometry::Rigid3& cam_from_world, const geometry::Rigid3& world_from_board,
                                               bool weighted = true);

/// Residuals (2, N) px without weights; nothing when a corner with a weight cannot be projected (others give infinity).
std::optional<Eigen::Matrix2Xd> ResidualsOf(const View& view, const geometry::Camera& camera,
                                            const geometry::Rigid3& cam_from_board);

}  // namespace mvstudio::calib
