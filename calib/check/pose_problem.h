// Private: the solver of CheckRig and of its search for moved cameras.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "calib/bundle/view.h"
#include "core/status.h"
#include "geometry/lens/camera.h"
#include "geometry/rigid/rigid3.h"

/// Adjusts board poses and the poses of some cameras, with everything else fixed.
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
  std::vector<geometry::Rigid3> world_from_board;  // per board and time step
};

/// Robust cost of a view with `squares`, the sum of squared weighted residuals, over `count` corners: 2 count k^2 log(1 +
/// squares / (2 count k^2)), k = 3. `weight`, when given, receives its derivative.
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

/// Levenberg-Marquardt over the pose of one camera and those of `boards`, which it sees.
FreeCamera SolveCamera(const PoseProblem& problem, const std::vector<int>& boards, int camera, PoseState* state);

}  // namespace mvstudio::calib::internal
