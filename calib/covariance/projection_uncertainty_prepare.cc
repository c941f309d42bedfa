#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <optional>

#include "calib/covariance/omitted_terms.h"
#include "calib/covariance/projection_uncertainty_prepared.h"
#include "core/check.h"
#include "core/statistics.h"
#include "geometry/rigid/cross_matrix.h"

namespace mvstudio::calib {
namespace internal {}  // namespace internal

namespace {

using Eigen::Index;
using internal::Component;
using internal::Matrix6;

constexpr double kSingular = 1e-12;       // of eigenvalues, with unit diagonal; the same as for the covariance of the rig
constexpr double kSingularBoard = 1e-10;  // the same of one board's pose

/// Smallest over largest eigenvalue by (inverse) power iteration.
double EigenvalueRatio(const Eigen::MatrixXd& lower, const Eigen::LLT<Eigen::MatrixXd>& factor) {
  constexpr int kSteps = 20;
  Eigen::VectorXd large = Eigen::VectorXd::LinSpaced(lower.rows(), 1, 1.7).normalized(), small = large;
  double largest = 0, inverse_of_smallest = 0;
  for (int step = 0; step < kSteps; ++step) {
    large = lower.selfadjointView<Eigen::Lower>() * large;
    small = factor.solve(small);
    largest = large.norm(), inverse_of_smallest = small.norm();
    large /= largest, small /= inverse_of_smallest;
  }
  return 1 / (largest * inverse_of_smallest);
}

}  // namespace

/// Numbers the groups of cameras that shared boards link; returns the group of every frame, -1 for those without corners.
std::vector<int> ProjectionUncertainty::Prepared::LinkFrames(const std::vector<View>& views) {
  const int cameras = static_cast<int>(state.cameras.size());
  std::vector<int> parent(cameras + state.world_from_board.size());
  std::iota(parent.begin(), parent.end(), 0);
  const auto root = [&](int i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
  };
  std::vector<bool> used(parent.size(), false);
  for (const View& view : views) {
    if (!(view.weights.array() > 0).any()) continue;
    used[view.camera_idx] = used[cameras + view.frame] = true;
    parent[root(cameras + view.frame)] = root(view.camera_idx);
  }
  std::map<int, int> number;
  std::vector<int> of_node(parent.size(), -1);
  for (size_t i = 0; i < parent.size(); ++i) {
    if (used[i]) of_node[i] = number.insert({root(static_cast<int>(i)), static_cast<int>(number.size())}).first->second;
  }
  components.resize(number.size());
  component_of_camera.assign(of_node.begin(), of_node.begin() + cameras);
  return std::vector<int>(of_node.begin() + cameras, of_node.end());
}

/// Sums over the boards; `frames` are those of the system's blocks.
void ProjectionUncertainty::Prepared::AddBoards(const SchurSystem& system, const std::vector<int>& frames,
                                                const std::vector<int>& component_of_frame, int gauge_frame) {
  for (Component& component : components) component.by_global.setZero(system.g.size(), 6);
  std::vector<std::optional<Matrix6>> inverses(frames.size());
  for (size_t b = 0; b < frames.size(); ++b) {
    const Matrix6 h = system.block_h.middleCols<6>(static_cast<Index>(6 * b));
    const Eigen::Matrix<double, 6, 1> unit = h.diagonal().array().max(1e-300).sqrt().inverse();
    const Eigen::LLT<Matrix6> block(unit.asDiagonal() * h * unit.asDiagonal());
    if (frames[b] != gauge_frame && (block.info() != Eigen::Success || !(block.rcond() > kSingularBoard))) continue;
    inverses[b] = unit.asDiagonal() * block.solve(Matrix6::Identity()) * unit.asDiagonal();
    Component& component = components[component_of_frame[frames[b]]];
    component.origin += state.world_from_board[frames[b]].translation;
    ++component.num_frames;
  }
  for (Component& component : components) component.origin /= std::max(1, component.num_frames);
  for (size_t b = 0; b < frames.size(); ++b) {
    if (!inverses[b] || frames[b] == gauge_frame) continue;
    Component& component = components[component_of_frame[frames[b]]];
    Matrix6 m = Matrix6::Identity();
    m.bottomLeftCorner<3, 3>() = geometry::CrossMatrix(state.world_from_board[frames[b]].translation - component.origin);
    const Matrix6 right = *inverses[b] * m.transpose() / component.num_frames;
    component.own += m * right / component.num_frames;
    for (Index i = system.begin[b]; i < system.begin[b + 1]; ++i)
      component.by_global.row(system.columns[i]) -= system.w.col(i).transpose() * right;
  }
}

/// The median distance of each camera's corners, and the middle and outermost corners of every board.
void ProjectionUncertainty::Prepared::NotePlaces(const std::vector<View>& views) {
  std::vector<std::vector<double>> ranges(state.cameras.size());
  std::map<int, std::vector<Eigen::Vector3d>> of_frame;
  for (const View& view : views) {
    const geometry::Rigid3 cam_from_board = CamFromBoard(view, state);
    const geometry::Rigid3 world_from_board = state.world_from_board[view.frame] * state.rig_from_board[view.board];
    for (Index i = 0; i < view.size(); ++i) {
      if (view.weights[i] <= 0) continue;
      ranges[view.camera_idx].push_back((cam_from_board * Eigen::Vector3d(view.x_in_board.col(i))).norm());
      of_frame[view.frame].push_back(world_from_board * Eigen::Vector3d(view.x_in_board.col(i)));
    }
  }
  for (const auto& camera : ranges) range_m.push_back(UpperMedian(camera));
  for (const auto& [frame, points] : of_frame) {
    Eigen::Vector3d middle = Eigen::Vector3d::Zero();
    for (const Eigen::Vector3d& x : points) middle += x / static_cast<double>(points.size());
    places.push_back(middle);
    for (int axis = 0; axis < 3; ++axis) {
      const auto [low, high] =
          std::minmax_element(points.begin(), points.end(), [axis](const auto& a, const auto& b) { return a[axis] < b[axis]; });
      places.push_back(*low), places.push_back(*high);
    }
  }
}

/// With S = Q Q^T of the held columns, theirs and the estimated ones' common errors have the root [-H_xx^-1 H_xy; I] Q.
void ProjectionUncertainty::Prepared::Carry(const Eigen::MatrixXd& normal, const FreedProblem& freed) {
  const Index held = static_cast<Index>(freed.held.size());
  carried.conservativeResize(columns.total, carried.cols() + held);
  carried.rightCols(held).setZero();
  if (held == 0) return;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(freed.covariance);
  const Eigen::MatrixXd root = eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal();
  auto block = carried.rightCols(held);
  block(freed.held, Eigen::all) = root;
  if (estimated.empty()) return;
  const Eigen::MatrixXd right = scale.asDiagonal() * normal(freed.estimated, freed.held);
  block(freed.estimated, Eigen::all) = -(scale.asDiagonal() * factor.solve(right)) * root;
}

/// The shift by terms that lenses were spared is one more root.
void ProjectionUncertainty::Prepared::CarryOmitted(const Eigen::VectorXd& gradient, const BundleOptions& options) {
  carried = Eigen::MatrixXd::Zero(columns.total, 0);
  std::vector<Index> rows;  // among the estimated columns
  for (const Index column : OmittedColumns(columns, options)) {
    const auto found = std::lower_bound(estimated.begin(), estimated.end(), column);
    if (found != estimated.end() && *found == column) rows.push_back(found - estimated.begin());
  }
  if (rows.empty()) return;
  const Index n = static_cast<Index>(estimated.size());
  Eigen::MatrixXd inverse = Eigen::MatrixXd::Zero(n, static_cast<Index>(rows.size()));
  for (size_t k = 0; k < rows.size(); ++k) inverse(rows[k], static_cast<Index>(k)) = scale[rows[k]];
  inverse = scale.asDiagonal() * factor.solve(inverse);
  carried = Eigen::MatrixXd::Zero(columns.total, 1);
  carried(estimated, 0) = OmittedShift(inverse, rows, gradient(estimated));
}

void ProjectionUncertainty::Prepared::Fill(const std::vector<View>& views, const BundleOptions& options,
                                           const HeldCovariance& held) {
  const std::vector<int> component_of_frame = LinkFrames(views);
  for (const geometry::Camera& camera : state.cameras) projectors.emplace_back(camera);
  NotePlaces(views);
  const FreedProblem freed = FreeHeld(views, state, options, held);
  RigProblem problem(views, freed.state, freed.options);
  columns = problem.columns(), estimated = freed.estimated;
  SchurSystem system;
  problem.AllocateSystem(&system);
  problem.Try(Eigen::VectorXd::Zero(system.g.size()), Eigen::MatrixXd::Zero(6, system.num_blocks()));
  if (!problem.LinearizeTrial(&system)) {
    status = Status::kBehindCamera;
    return;
  }
  const ReducedSystem equations = Reduce(system, 0, options.num_threads);
  const Eigen::MatrixXd normal = equations.h.selfadjointView<Eigen::Lower>();
  Eigen::MatrixXd reduced = normal(estimated, estimated);
  scale = (reduced.diagonal().array() > 0).select(reduced.diagonal().array().abs().sqrt().inverse(), 1);
  if (reduced.size() > 0) {
    reduced = scale.asDiagonal() * reduced * scale.asDiagonal();
    factor.compute(reduced);
    if (factor.info() != Eigen::Success || !(EigenvalueRatio(reduced, factor) > kSingular)) {
      status = Status::kDegenerate;
      return;
    }
  }
  CarryOmitted(equations.g, options);
  Carry(normal, freed);
  std::vector<int> frames;  // one block each, ascending
  for (size_t f = 0; f < component_of_frame.size(); ++f) {
    if (component_of_frame[f] >= 0) frames.push_back(static_cast<int>(f));
  }
  MVS_CHECK(static_cast<int>(frames.size()) == system.num_blocks(), "frames and blocks differ in number");
  AddBoards(system, frames, component_of_frame, options.gauge.kind == Gauge::Kind::kBoard ? options.gauge.index : -1);
}

}  // namespace mvstudio::calib
