#include "calib/check/pose_problem.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "geometry/rigid/cross_matrix.h"

namespace mvstudio::calib::internal {
namespace {

using geometry::Rigid3;
using geometry::Vector6d;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Normal equations of one board: its own block and those of the free camera, if that sees it.
struct BoardNormal {
  Matrix6d board = Matrix6d::Zero(), camera = Matrix6d::Zero(), cross = Matrix6d::Zero();  // cross: camera x board
  Vector6d board_gradient = Vector6d::Zero(), camera_gradient = Vector6d::Zero();
  double cost = 0;
  bool ok = true;
};

/// `camera` -1: none is free.
BoardNormal Accumulate(const PoseProblem& problem, const PoseState& state, int board, int camera) {
  BoardNormal normal;
  for (const int v : problem.views_of_board[static_cast<size_t>(board)]) {
    const View& view = problem.views[static_cast<size_t>(v)];
    const Rigid3& cam_from_world = state.cam_from_world[static_cast<size_t>(view.camera_idx)];
    const Rigid3& world_from_board = state.world_from_board[static_cast<size_t>(board)];
    const auto linear =
        LinearizeView(view, problem.cameras[static_cast<size_t>(view.camera_idx)], cam_from_world * world_from_board, false);
    if (!linear) {
      normal.ok = false;
      return normal;
    }
    double weight = 1;
    const Eigen::Index count = (view.weights.array() > 0).count();
    normal.cost += RobustViewCost(linear->residuals.squaredNorm(), count, &weight);
    const Matrix6d m = weight * linear->d_pose.transpose() * linear->d_pose;
    const Vector6d g = weight * linear->d_pose.transpose() * linear->residuals;
    const Eigen::Matrix3d cam_r_world = cam_from_world.rotation.toRotationMatrix();
    Matrix6d by_board = Matrix6d::Zero(), by_camera = Matrix6d::Identity();
    by_board.topLeftCorner<3, 3>() = by_board.bottomRightCorner<3, 3>() = cam_r_world;
    by_camera.bottomLeftCorner<3, 3>() = -geometry::CrossMatrix(cam_r_world * world_from_board.translation);
    normal.board += by_board.transpose() * m * by_board;
    normal.board_gradient += by_board.transpose() * g;
    if (view.camera_idx != camera) continue;
    normal.camera += by_camera.transpose() * m * by_camera;
    normal.camera_gradient += by_camera.transpose() * g;
    normal.cross += by_camera.transpose() * m * by_board;
  }
  return normal;
}

Matrix6d Damped(Matrix6d hessian, double damping) {
  hessian.diagonal() *= 1 + damping;
  hessian.diagonal().array() += 1e-300;
  return hessian;
}

/// The camera's equations with one board eliminated.
struct Reduced {
  Matrix6d hessian;
  Vector6d gradient;
};
Reduced Eliminate(const BoardNormal& normal, double damping) {
  const Eigen::LDLT<Matrix6d> board(Damped(normal.board, damping));
  return {normal.camera - normal.cross * board.solve(normal.cross.transpose()),
          normal.camera_gradient - normal.cross * board.solve(normal.board_gradient)};
}

/// One step of all poses; nothing when it is not finite.
std::optional<PoseState> Step(const std::vector<BoardNormal>& normals, const std::vector<int>& boards, int camera,
                              double damping, const PoseState& state) {
  PoseState next = state;
  Vector6d camera_step = Vector6d::Zero();
  if (camera >= 0) {
    Reduced sum{Matrix6d::Zero(), Vector6d::Zero()};
    for (const BoardNormal& normal : normals) {
      const Reduced one = Eliminate(normal, damping);
      sum.hessian += one.hessian, sum.gradient += one.gradient;
    }
    camera_step = Damped(sum.hessian, damping).ldlt().solve(-sum.gradient);
    if (!camera_step.allFinite()) return std::nullopt;
    Rigid3& pose = next.cam_from_world[static_cast<size_t>(camera)];
    pose = geometry::Perturb(camera_step, pose);
  }
  for (size_t i = 0; i < boards.size(); ++i) {
    const Vector6d step =
        Damped(normals[i].board, damping).ldlt().solve(-normals[i].board_gradient - normals[i].cross.transpose() * camera_step);
    if (!step.allFinite()) return std::nullopt;
    Rigid3& pose = next.world_from_board[static_cast<size_t>(boards[i])];
    pose = geometry::Perturb(step, pose);
  }
  return next;
}

std::vector<BoardNormal> AccumulateAll(const PoseProblem& problem, const PoseState& state, const std::vector<int>& boards,
                                       int camera, double* cost) {
  std::vector<BoardNormal> normals;
  *cost = 0;
  for (const int board : boards) {
    normals.push_back(Accumulate(problem, state, board, camera));
    *cost = normals.back().ok ? *cost + normals.back().cost : kInfinity;
  }
  return normals;
}

/// Levenberg-Marquardt; returns the equations at the end. An infinite cost means that the start is unusable.
std::vector<BoardNormal> Minimize(const PoseProblem& problem, const std::vector<int>& boards, int camera, PoseState* state,
                                  double* cost) {
  std::vector<BoardNormal> normals = AccumulateAll(problem, *state, boards, camera, cost);
  double damping = 1e-4;
  for (int i = 0; i < 60 && damping < 1e10 && std::isfinite(*cost); ++i) {
    const auto next = Step(normals, boards, camera, damping, *state);
    double next_cost = kInfinity;
    if (next) next_cost = BoardsCost(problem, *next, boards);
    if (next_cost <= *cost) {
      const bool done = *cost - next_cost <= 1e-9 * (1 + *cost);
      *state = *next;
      normals = AccumulateAll(problem, *state, boards, camera, cost);
      damping = std::max(1e-12, 0.1 * damping);
      if (done) break;
    } else {
      damping *= 10;
    }
  }
  return normals;
}

/// How much more the boards disagree among each other than their noise allows: mean of r^T S^-1 r over boards, 6 degrees of
/// freedom each; expected 1.
double Disagreement(const std::vector<Reduced>& boards) {
  double sum = 0;
  for (const Reduced& board : boards) sum += board.gradient.dot(board.hessian.ldlt().solve(board.gradient));
  return boards.size() > 2 ? sum / (6.0 * (static_cast<double>(boards.size()) - 1)) : 0;
}

/// Weighted squares per degree of freedom of the boards.
double ReducedChiSquare(const PoseProblem& problem, const PoseState& state, const std::vector<int>& boards) {
  double squares = 0, freedom = -6;
  for (const int board : boards) {
    freedom -= 6;
    for (const int v : problem.views_of_board[static_cast<size_t>(board)]) {
      const Eigen::Index count = (problem.views[static_cast<size_t>(v)].weights.array() > 0).count();
      double weight = 1;
      const double s = ViewSquares(problem, state, v);
      RobustViewCost(s, count, &weight);
      if (std::isfinite(s)) squares += weight * s;
      freedom += 2.0 * weight * static_cast<double>(count);
    }
  }
  return freedom > 0 ? squares / freedom : 1;
}

}  // namespace

double RobustViewCost(double squares, Eigen::Index count, double* weight) {
  constexpr double kSquare = 9;
  const double scale = 2 * static_cast<double>(std::max<Eigen::Index>(count, 1)) * kSquare;
  if (weight) *weight = 1 / (1 + squares / scale);
  return scale * std::log1p(squares / scale);
}

double ViewSquares(const PoseProblem& problem, const PoseState& state, int view_idx) {
  const View& view = problem.views[static_cast<size_t>(view_idx)];
  const size_t camera = static_cast<size_t>(view.camera_idx);
  const Rigid3& world_from_board =
      state.world_from_board[static_cast<size_t>(problem.board_of_view[static_cast<size_t>(view_idx)])];
  const auto residuals = ResidualsOf(view, problem.cameras[camera], state.cam_from_world[camera] * world_from_board);
  if (!residuals) return kInfinity;
  double squares = 0;
  for (Eigen::Index i = 0; i < view.size(); ++i) {
    if (view.weights[i] > 0) squares += view.weights[i] * residuals->col(i).squaredNorm();
  }
  return squares;
}

double BoardsCost(const PoseProblem& problem, const PoseState& state, const std::vector<int>& boards) {
  double cost = 0;
  for (const int board : boards) {
    for (const int v : problem.views_of_board[static_cast<size_t>(board)]) {
      const Eigen::Index count = (problem.views[static_cast<size_t>(v)].weights.array() > 0).count();
      cost += RobustViewCost(ViewSquares(problem, state, v), count, nullptr);
    }
  }
  return cost;
}

void SolveBoards(const PoseProblem& problem, const std::vector<int>& boards, PoseState* state) {
  double cost = 0;
  for (const int board : boards) Minimize(problem, {board}, -1, state, &cost);  // without a free camera boards are independent
}

FreeCamera SolveCamera(const PoseProblem& problem, const std::vector<int>& boards, int camera, PoseState* state) {
  FreeCamera result;
  result.num_boards = static_cast<int>(boards.size());
  const std::vector<BoardNormal> normals = Minimize(problem, boards, camera, state, &result.cost);
  if (!std::isfinite(result.cost)) {
    result.status = Status::kBehindCamera;
    return result;
  }
  std::vector<Reduced> reduced;
  Matrix6d hessian = Matrix6d::Zero();
  for (const BoardNormal& normal : normals) {
    reduced.push_back(Eliminate(normal, 0));
    hessian += reduced.back().hessian;
  }
  const Eigen::LDLT<Matrix6d> factor(hessian);
  const double widening = std::max(Disagreement(reduced), ReducedChiSquare(problem, *state, boards));
  result.covariance = widening * factor.solve(Matrix6d::Identity());
  if (!factor.isPositive() || !result.covariance.allFinite() || !(result.covariance.diagonal().minCoeff() > 0)) {
    result.status = Status::kDegenerate;
  }
  return result;
}

}  // namespace mvstudio::calib::internal
