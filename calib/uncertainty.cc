#include "calib/uncertainty.h"

#include <Eigen/QR>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

#include "core/check.h"

namespace mvstudio::calib {
namespace {

constexpr double kRankTolerance = 1e-9;
constexpr const char* kPoseNames[] = {"rotation x", "rotation y", "rotation z", "position x", "position y", "position z"};

/// Where each camera's unknowns stand among the columns.
struct Columns {
  std::vector<int> params, pose;  // first column; pose is -1 for the camera that the gauge fixes
  int total = 0;

  Columns(const RigState& state, const Gauge& gauge) {
    for (size_t c = 0; c < state.cameras.size(); ++c) {
      params.push_back(total);
      total += static_cast<int>(state.cameras[c].params.size());
      const bool fixed = gauge.kind == Gauge::Kind::kCamera && gauge.index == static_cast<int>(c);
      pose.push_back(fixed ? -1 : total);
      if (!fixed) total += 6;
    }
  }
};

/// The rows of one frame, with the board eliminated unless the gauge fixes it.
Eigen::MatrixXd ReducedRows(const std::vector<const View*>& views, const RigState& state, const Columns& columns,
                            bool board_is_fixed) {
  Eigen::Index rows = 0;
  for (const View* view : views) rows += 2 * view->size();
  Eigen::MatrixXd cameras = Eigen::MatrixXd::Zero(rows, columns.total), board = Eigen::MatrixXd::Zero(rows, 6);
  Eigen::Index row = 0;
  for (const View* view : views) {
    const int c = view->camera_idx;
    const auto linear = LinearizeView(*view, state.cameras[c], state.cam_from_world[c], state.world_from_board[view->frame]);
    MVS_CHECK(linear.has_value(), "the solution does not project its own corners");
    const Eigen::Index n = linear->residuals.size();
    cameras.block(row, columns.params[c], n, linear->d_params.cols()) = linear->d_params;
    if (columns.pose[c] >= 0) cameras.block(row, columns.pose[c], n, 6) = linear->d_cam;
    board.middleRows(row, n) = linear->d_board;
    row += n;
  }
  if (board_is_fixed || rows <= 6) return board_is_fixed ? cameras : Eigen::MatrixXd(0, columns.total);
  const Eigen::HouseholderQR<Eigen::MatrixXd> qr(board);
  cameras.applyOnTheLeft(qr.householderQ().transpose());
  return cameras.bottomRows(rows - 6);
}

/// Upper triangle R with R^T R equal to that of the stacked rows.
Eigen::MatrixXd Triangle(const Eigen::MatrixXd& stacked) {
  if (stacked.rows() <= stacked.cols()) return stacked;
  const Eigen::HouseholderQR<Eigen::MatrixXd> qr(stacked);
  return qr.matrixQR().topRows(stacked.cols()).triangularView<Eigen::Upper>();
}

Eigen::MatrixXd StackFrames(const std::vector<View>& views, const RigState& state, const Gauge& gauge, const Columns& columns) {
  Eigen::MatrixXd triangle(0, columns.total);
  for (int frame = 0; frame < static_cast<int>(state.frames.size()); ++frame) {
    std::vector<const View*> of_frame;
    for (const View& view : views) {
      if (view.frame == frame && (view.weights.array() > 0).any()) of_frame.push_back(&view);
    }
    if (of_frame.empty()) continue;
    const bool fixed = gauge.kind == Gauge::Kind::kBoard && gauge.index == frame;
    const Eigen::MatrixXd rows = ReducedRows(of_frame, state, columns, fixed);
    Eigen::MatrixXd stacked(triangle.rows() + rows.rows(), columns.total);
    stacked << triangle, rows;
    triangle = Triangle(stacked);
  }
  return triangle;
}

std::vector<std::string> ColumnNames(const RigState& state, const Columns& columns) {
  std::vector<std::string> names(columns.total);
  for (size_t c = 0; c < state.cameras.size(); ++c) {
    const std::string prefix = state.cameras[c].name + ": ";
    const std::vector<std::string> params = geometry::ParamNames(state.cameras[c].model);
    for (size_t i = 0; i < params.size(); ++i) names[columns.params[c] + i] = prefix + params[i];
    for (int i = 0; columns.pose[c] >= 0 && i < 6; ++i) names[columns.pose[c] + i] = prefix + kPoseNames[i];
  }
  return names;
}

/// The parameter with the largest share in each null direction.
void NameNullDirections(const Eigen::MatrixXd& directions, const std::vector<std::string>& names, RigCovariance* result) {
  for (Eigen::Index k = 0; k < directions.cols(); ++k) {
    Eigen::Index largest = 0;
    directions.col(k).cwiseAbs().maxCoeff(&largest);
    if (std::find(result->undetermined.begin(), result->undetermined.end(), names[largest]) == result->undetermined.end()) {
      result->undetermined.push_back(names[largest]);
    }
  }
  result->status = Status::kDegenerate;
  result->message = std::to_string(directions.cols()) + " directions of the solution are not determined by the boards, first " +
                    result->undetermined.front() + ": show the board tilted, nearer and farther, and to cameras in pairs";
}

void SplitCovariance(const RigState& state, const Columns& columns, RigCovariance* result) {
  for (size_t c = 0; c < state.cameras.size(); ++c) {
    const Eigen::Index p = state.cameras[c].params.size();
    result->params.push_back(result->joint.block(columns.params[c], columns.params[c], p, p));
    Eigen::Matrix<double, 6, 6> pose = Eigen::Matrix<double, 6, 6>::Zero();
    if (columns.pose[c] >= 0) pose = result->joint.block<6, 6>(columns.pose[c], columns.pose[c]);
    result->cam_from_world.push_back(pose);
  }
}

}  // namespace

RigCovariance ComputeCovariance(const std::vector<View>& views, const RigState& state, const Gauge& gauge, double sigma_px) {
  const Columns columns(state, gauge);
  Eigen::MatrixXd triangle = Eigen::MatrixXd::Zero(columns.total, columns.total);
  const Eigen::MatrixXd stacked = StackFrames(views, state, gauge, columns);
  triangle.topRows(stacked.rows()) = stacked;
  Eigen::VectorXd scale = triangle.colwise().norm();
  for (Eigen::Index i = 0; i < scale.size(); ++i) scale[i] = scale[i] > 0 ? 1 / scale[i] : 1;
  const Eigen::BDCSVD<Eigen::MatrixXd> svd(triangle * scale.asDiagonal(), Eigen::ComputeFullV);
  const Eigen::VectorXd& values = svd.singularValues();
  const auto rank = (values.array() > kRankTolerance * values[0]).count();
  RigCovariance result;
  if (rank < columns.total) {
    NameNullDirections(svd.matrixV().rightCols(columns.total - rank), ColumnNames(state, columns), &result);
    return result;
  }
  const Eigen::MatrixXd root = sigma_px * scale.asDiagonal() * svd.matrixV() * values.cwiseInverse().asDiagonal();
  result.joint = root * root.transpose();
  SplitCovariance(state, columns, &result);
  return result;
}

}  // namespace mvstudio::calib
