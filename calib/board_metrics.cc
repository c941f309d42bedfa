#include "calib/board_metrics.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "core/check.h"
#include "geometry/camera.h"

namespace mvstudio::calib {
namespace {

using Eigen::Index;
using geometry::Projector;
using geometry::Rigid3;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kParallel = 1e-12;  // smallest over largest eigenvalue of the rays' normal equations

struct Sight {
  int camera_idx;
  Eigen::Vector2d px;
};

/// Point nearest to the rays of all sights that have one; nothing without two rays or when they are parallel.
std::optional<Eigen::Vector3d> NearestToRays(const std::vector<Projector>& projectors, const RigState& state,
                                             std::vector<Sight>* sights) {
  std::vector<Sight> kept;
  std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>> rays;  // centre, direction
  for (const Sight& sight : *sights) {
    const geometry::Unprojection ray = projectors[sight.camera_idx].Unproject(sight.px);
    if (ray.status != Status::kOk) continue;
    const Rigid3 world_from_cam = geometry::Inverse(state.cam_from_world[sight.camera_idx]);
    rays.emplace_back(world_from_cam.translation, world_from_cam.rotation * ray.ray_in_cam);
    kept.push_back(sight);
  }
  *sights = kept;
  if (rays.size() < 2) return std::nullopt;
  const Eigen::Vector3d origin = rays[0].first;
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (const auto& [centre, direction] : rays) {
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - direction * direction.transpose();
    normal += across, right += across * (centre - origin);
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(normal);
  if (!(eigen.eigenvalues()[0] > kParallel * eigen.eigenvalues()[2])) return std::nullopt;
  return origin + normal.ldlt().solve(right);
}

/// Normal equations of the pixel errors at a point; nothing where a camera does not see it.
struct PixelEquations {
  double cost = 0;
  Eigen::Matrix3d h = Eigen::Matrix3d::Zero();
  Eigen::Vector3d g = Eigen::Vector3d::Zero();
};

std::optional<PixelEquations> Linearize(const std::vector<Projector>& projectors, const RigState& state,
                                        const std::vector<Sight>& sights, const Eigen::Vector3d& x_in_world) {
  PixelEquations out;
  for (const Sight& sight : sights) {
    const Rigid3& cam_from_world = state.cam_from_world[sight.camera_idx];
    const auto at = projectors[sight.camera_idx].ProjectWithJacobians(cam_from_world * x_in_world);
    if (at.status != Status::kOk) return std::nullopt;
    const Eigen::Vector2d residual = at.px - sight.px;
    const Eigen::Matrix<double, 2, 3> d = at.d_px_d_x * cam_from_world.rotation.toRotationMatrix();
    out.cost += residual.squaredNorm();
    out.h += d.transpose() * d, out.g += d.transpose() * residual;
  }
  return out;
}

/// Least squares of the pixel errors by damped Gauss-Newton steps from the rays. `sights` loses those without a ray.
std::optional<Eigen::Vector3d> Triangulate(const std::vector<Projector>& projectors, const RigState& state,
                                           std::vector<Sight>* sights) {
  std::optional<Eigen::Vector3d> x = NearestToRays(projectors, state, sights);
  if (!x) return std::nullopt;
  auto at = Linearize(projectors, state, *sights, *x);
  double damping = 0;
  constexpr int kMaxTrials = 50;
  for (int trial = 0; at && trial < kMaxTrials; ++trial) {
    Eigen::Matrix3d h = at->h;
    h.diagonal() *= 1 + damping;
    const Eigen::Vector3d step = -h.ldlt().solve(at->g);
    if (!step.allFinite()) return std::nullopt;
    const double predicted = -at->g.dot(step);
    if (predicted <= 1e-14 * at->cost) break;
    const auto next = Linearize(projectors, state, *sights, *x + step);
    if (next && next->cost <= at->cost) {
      *x += step, at = next, damping /= 10;
    } else {
      damping = std::max(1e-4, 10 * damping);
    }
  }
  if (!at) return std::nullopt;
  return x;
}

/// The triangulated corners of one board in one frame.
using Cloud = std::map<int, Eigen::Vector3d>;

double Rms(const std::vector<double>& values) {
  double sum = 0;
  for (double value : values) sum += value * value;
  return values.empty() ? kNan : std::sqrt(sum / static_cast<double>(values.size()));
}

double Mean(const std::vector<double>& values) {
  double sum = 0;
  for (double value : values) sum += value;
  return values.empty() ? kNan : sum / static_cast<double>(values.size());
}

/// Of the absolute values; the mean of the middle two when their number is even.
double MedianAbs(std::vector<double> values) {
  if (values.empty()) return kNan;
  for (double& value : values) value = std::abs(value);
  std::sort(values.begin(), values.end());
  const size_t n = values.size();
  return (values[(n - 1) / 2] + values[n / 2]) / 2;
}

struct Errors {
  std::vector<double> edges_mm, pairs_mm, pixels;
};

/// Measured minus true length of a pair of corners.
double LengthError(const Eigen::Matrix3Xd& corners, const Cloud& cloud, int a, int b) {
  return 1e3 * ((cloud.at(a) - cloud.at(b)).norm() - (corners.col(a) - corners.col(b)).norm());
}

void Measure(const Eigen::Matrix3Xd& corners, const std::vector<std::pair<int, int>>& neighbours, const Cloud& cloud,
             Errors* errors) {
  for (const auto& [a, b] : neighbours) {
    if (cloud.count(a) && cloud.count(b)) errors->edges_mm.push_back(LengthError(corners, cloud, a, b));
  }
  for (auto a = cloud.begin(); a != cloud.end(); ++a) {
    for (auto b = std::next(a); b != cloud.end(); ++b)
      errors->pairs_mm.push_back(LengthError(corners, cloud, a->first, b->first));
  }
}

std::vector<std::pair<int, int>> MutualNearest(const Eigen::Matrix3Xd& corners) {
  constexpr double kEqual = 1 + 1e-6;
  std::vector<double> nearest(corners.cols(), std::numeric_limits<double>::infinity());
  for (Index i = 0; i < corners.cols(); ++i) {
    for (Index j = 0; j < corners.cols(); ++j) {
      if (i != j) nearest[i] = std::min(nearest[i], (corners.col(i) - corners.col(j)).norm());
    }
  }
  std::vector<std::pair<int, int>> pairs;
  for (Index i = 0; i < corners.cols(); ++i) {
    for (Index j = i + 1; j < corners.cols(); ++j) {
      const double distance = (corners.col(i) - corners.col(j)).norm();
      if (distance <= kEqual * std::min(nearest[i], nearest[j])) pairs.emplace_back(i, j);
    }
  }
  return pairs;
}

}  // namespace

std::vector<std::pair<int, int>> NeighbouringCorners(const Board& board) {
  if (board.kind == Board::Kind::kPoints) return MutualNearest(CornersInBoard(board));
  std::vector<std::pair<int, int>> pairs;
  if (board.has_tags()) {
    for (int first = 0; first + 3 < board.num_corners(); first += 4) {
      for (int k = 0; k < 4; ++k) {
        const int a = first + k, b = first + (k + 1) % 4;
        pairs.emplace_back(std::min(a, b), std::max(a, b));
      }
    }
    return pairs;
  }
  for (int row = 0; row < board.rows; ++row) {
    for (int col = 0; col < board.cols; ++col) {
      const int id = row * board.cols + col;
      if (col + 1 < board.cols) pairs.emplace_back(id, id + 1);
      if (row + 1 < board.rows) pairs.emplace_back(id, id + board.cols);
    }
  }
  return pairs;
}

BoardMetrics ComputeBoardMetrics(const std::vector<Board>& boards, const std::vector<View>& views, const RigState& state) {
  std::vector<Projector> projectors;
  for (const geometry::Camera& camera : state.cameras) projectors.emplace_back(camera);
  std::map<std::pair<int, int>, std::map<int, std::vector<Sight>>> sights;  // by frame and board, then by corner
  for (const View& view : views) {
    MVS_CHECK(view.board >= 0 && view.board < static_cast<int>(boards.size()), "board " << view.board);
    auto& of_board = sights[{view.frame, view.board}];
    for (Index i = 0; i < view.size(); ++i) of_board[view.corner_ids[i]].push_back({view.camera_idx, view.px.col(i)});
  }
  std::vector<std::vector<std::pair<int, int>>> neighbours;
  std::vector<Eigen::Matrix3Xd> corners;
  for (const Board& board : boards) neighbours.push_back(NeighbouringCorners(board)), corners.push_back(CornersInBoard(board));
  BoardMetrics metrics;
  Errors errors;
  std::set<int> frames;
  for (auto& [place, of_board] : sights) {
    Cloud cloud;
    for (auto& [id, seen] : of_board) {
      if (seen.size() < 2) continue;
      const std::optional<Eigen::Vector3d> x = Triangulate(projectors, state, &seen);
      if (!x) continue;
      cloud[id] = *x;
      for (const Sight& sight : seen) {
        const auto at = projectors[sight.camera_idx].Project(state.cam_from_world[sight.camera_idx] * *x);
        errors.pixels.push_back((at.px - sight.px).norm());
      }
    }
    if (!cloud.empty()) frames.insert(place.first);
    metrics.num_points += static_cast<int>(cloud.size());
    Measure(corners[place.second], neighbours[place.second], cloud, &errors);
  }
  metrics.edge_rms_mm = Rms(errors.edges_mm), metrics.edge_median_mm = MedianAbs(errors.edges_mm);
  metrics.edge_bias_mm = Mean(errors.edges_mm);
  metrics.pair_rms_mm = Rms(errors.pairs_mm), metrics.pair_bias_mm = Mean(errors.pairs_mm);
  metrics.reprojection_rms_px = Rms(errors.pixels), metrics.reprojection_median_px = MedianAbs(errors.pixels);
  metrics.num_frames = static_cast<int>(frames.size()), metrics.num_edges = static_cast<int>(errors.edges_mm.size());
  return metrics;
}

}  // namespace mvstudio::calib
