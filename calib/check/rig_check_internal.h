#pragma once

#include <Eigen/Core>
#include <vector>

#include "calib/bundle/view.h"
#include "calib/check/rig_check.h"
#include "core/status.h"
#include "geometry/lens/camera.h"
#include "geometry/rig/rig_covariance.h"
#include "geometry/rigid/rigid3.h"

/// Board poses and the poses of some cameras from views, everything else fixed. For rig_check*.cc.
namespace mvstudio::calib::internal {

using Matrix6d = Eigen::Matrix<double, 6, 6>;

struct PoseProblem {
  std::vector<geometry::Camera> cameras;
  std::vector<View> views;         ///< weights are 1 / variance (px^-2); 0 for dropped corners
  std::vector<int> board_of_view;  ///< into PoseState::world_from_board
  std::vector<std::vector<int>> views_of_board;
};

struct PoseState {
  std::vector<geometry::Rigid3> cam_from_world;    // per camera
  std::vector<geometry::Rigid3> world_from_board;  // per board and instant
};

/// Robust cost of a view whose sum of squared weighted residuals is `squares` over `count` corners: 2 count k^2 log(1 + squares
/// / (2 count k^2)), k = 3; `weight`, when given, receives its derivative.
double RobustViewCost(double squares, Eigen::Index count, double* weight);

/// Sum of the squared weighted residuals of a view; infinity where it cannot be projected.
double ViewSquares(const PoseProblem& problem, const PoseState& state, int view);

/// Robust cost of the given boards.
double BoardsCost(const PoseProblem& problem, const PoseState& state, const std::vector<int>& boards);

struct FreeCamera {
  Status status = Status::kOk;
  double cost = 0;                         ///< robust, of the boards used
  Matrix6d covariance = Matrix6d::Zero();  ///< of its pose, left perturbation, boards marginalised
  int num_boards = 0;
};

/// Levenberg-Marquardt over the poses of `boards` alone.
void SolveBoards(const PoseProblem& problem, const std::vector<int>& boards, PoseState* state);

/// Over the pose of one camera and those of `boards`, which it sees.
FreeCamera SolveCamera(const PoseProblem& problem, const std::vector<int>& boards, int camera, PoseState* state);

/// Everything about one check.
struct CheckWork {
  const geometry::Rig& rig;
  RigCheckOptions options;
  PoseProblem problem;
  PoseState state;
  std::vector<std::vector<int>> all_views_of_board;  // problem.views_of_board with every camera's
  std::vector<geometry::Rigid3> own_pose;            // per view: cam_from_board
  std::vector<std::vector<int>> boards_of;           // per camera, those that it shares
  std::vector<CameraCheck> checks;                   // per camera of the rig
  std::vector<bool> present, moved;
};

/// Fits every view by itself, drops corners and views that do not fit, estimates each camera's noise, and keeps the views of
/// boards that two cameras share at one instant, with weights in px^-2.
void PrepareCheck(const CalibrateInput& input, CheckWork* work);

/// Enters the new pose of a camera that SolveCamera placed at `state` by `boards`, with the covariance `own` for an exact
/// calibration, into what the rig states: its covariance holds the part that comes from the lenses and poses of the cameras that
/// placed the boards and from its own lens, and is correlated with them. What is unknown of these adds nothing. The noise of
/// boards that two repaired cameras were placed by counts as independent between them.
void CarryIntoRepair(const CheckWork& work, const PoseState& state, const std::vector<int>& boards, int camera, const Matrix6d& own,
                     geometry::StatedCovariance* stated);

/// Distances of the corners from their projections, px; infinity for those that do not project.
Eigen::VectorXd CornerDistances(const View& view, const geometry::Camera& camera, const geometry::Rigid3& cam_from_board);

/// Lengths between corners that two cameras or more see, triangulated with the calibration as it is, against the board: `edge`
/// are the shortest lengths on the board, `pair` all of them.
BoardMetrics MeasureLengths(const std::vector<Board>& boards, const CheckWork& work);

/// Lengths by the calibration over lengths on the board: per pair of cameras and instant the scale of the similarity that takes
/// the board to its triangulated corners, the median over instants; of the pairs the lower third of |scale - 1|, for a camera
/// that moved spoils at most two thirds of them. 1 when nothing can be said.
double MeasureScale(const std::vector<Board>& boards, const CheckWork& work);

/// Sets check->verdict from the rest.
void JudgeCheck(const RigCheckOptions& options, RigCheck* check);

}  // namespace mvstudio::calib::internal
