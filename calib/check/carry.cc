#include <Eigen/Cholesky>
#include <cmath>

#include "calib/check/check_steps.h"
#include "calib/check/pose_problem.h"
#include "geometry/rigid/cross_matrix.h"

namespace mvstudio::calib::internal {
namespace {

using Eigen::Index;
using geometry::Rigid3;

/// A view's derivatives by its board's pose, its camera's pose and lens, rows weighted as in SolveCamera.
struct ViewDerivatives {
  Index lens = 0, pose = 0;  // first columns among the stated unknowns
  Eigen::MatrixXd by_board, by_pose, by_lens;
};

ViewDerivatives Differentiate(const PoseProblem& problem, const PoseState& state, int view_idx,
                              const geometry::StatedCovariance& stated) {
  const View& view = problem.views[static_cast<size_t>(view_idx)];
  const auto c = static_cast<size_t>(view.camera_idx);
  const Rigid3& board = state.world_from_board[static_cast<size_t>(problem.board_of_view[static_cast<size_t>(view_idx)])];
  const auto linear = LinearizeView(view, problem.cameras[c], state.cam_from_world[c] * board);
  ViewDerivatives out;
  out.lens = stated.begin[c], out.pose = stated.PoseRow(c);
  if (!linear) return out;
  double weight = 1;
  RobustViewCost(linear->residuals.squaredNorm(), (view.weights.array() > 0).count(), &weight);
  const Eigen::Matrix3d cam_r_world = state.cam_from_world[c].rotation.toRotationMatrix();
  Matrix6d by_board = Matrix6d::Zero(), by_camera = Matrix6d::Identity();
  by_board.topLeftCorner<3, 3>() = by_board.bottomRightCorner<3, 3>() = cam_r_world;
  by_camera.bottomLeftCorner<3, 3>() = -geometry::CrossMatrix(cam_r_world * board.translation);
  const double root = std::sqrt(weight);
  out.by_board = root * linear->d_pose * by_board;
  out.by_pose = root * linear->d_pose * by_camera;
  out.by_lens = root * linear->d_lens;
  return out;
}

/// Rows of the camera's pose in the normal equations over all stated unknowns, the boards eliminated.
Eigen::MatrixXd PoseRows(const CheckWork& work, const PoseState& state, const std::vector<int>& boards, int camera,
                         const geometry::StatedCovariance& stated) {
  Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(6, stated.joint.rows());
  const Index own_pose = stated.PoseRow(static_cast<size_t>(camera));
  for (const int board : boards) {
    std::vector<ViewDerivatives> views;
    Matrix6d normal = Matrix6d::Zero(), cross = Matrix6d::Zero();  // of the board; camera by board
    for (const int v : work.problem.views_of_board[static_cast<size_t>(board)]) {
      views.push_back(Differentiate(work.problem, state, v, stated));
      const ViewDerivatives& d = views.back();
      if (d.by_board.size() == 0) continue;
      normal += d.by_board.transpose() * d.by_board;
      if (d.pose == own_pose) cross += d.by_pose.transpose() * d.by_board;
    }
    const Matrix6d through_board = normal.ldlt().solve(cross.transpose()).transpose();
    for (const ViewDerivatives& d : views) {
      if (d.by_board.size() == 0) continue;
      Eigen::MatrixXd left = -d.by_board * through_board.transpose();  // residuals by the camera's pose, the board following
      if (d.pose == own_pose) left += d.by_pose;
      rows.middleCols<6>(d.pose) += left.transpose() * d.by_pose;
      rows.middleCols(d.lens, d.by_lens.cols()) += left.transpose() * d.by_lens;
    }
  }
  return rows;
}

}  // namespace

void CarryIntoRepair(const CheckWork& work, const PoseState& state, const std::vector<int>& boards, int camera,
                     const Matrix6d& own, geometry::StatedCovariance* stated) {
  const Index pose = stated->PoseRow(static_cast<size_t>(camera));
  Eigen::MatrixXd rows = PoseRows(work, state, boards, camera, *stated);
  const Matrix6d hessian = rows.middleCols<6>(pose);
  rows.middleCols<6>(pose).setZero();
  stated->joint.middleRows<6>(pose).setZero();  // of the pose that is no more
  stated->joint.middleCols<6>(pose).setZero();
  const Eigen::MatrixXd by_held = -hessian.ldlt().solve(rows), cross = by_held * stated->joint;
  stated->joint.middleRows<6>(pose) = cross;
  stated->joint.middleCols<6>(pose) = cross.transpose();
  stated->joint.block<6, 6>(pose, pose) = own + cross * by_held.transpose();
  stated->pose_known[static_cast<size_t>(camera)] = true;
}

}  // namespace mvstudio::calib::internal
