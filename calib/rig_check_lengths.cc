#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>

#include "calib/rig_check_internal.h"
#include "geometry/alignment.h"

namespace mvstudio::calib::internal {
namespace {

constexpr size_t kMaxPairs = 2000000;  ///< lengths that are kept of one kind; more say nothing new

struct Ray {
  Eigen::Vector3d origin, direction;  // in world, unit
  double weight;                      // rad^-2
};

/// The point nearest to all rays, in units of their angles; nothing when they are parallel to 1e-3 rad.
std::optional<Eigen::Vector3d> Intersect(const std::vector<Ray>& rays) {
  double widest = 0;
  for (const Ray& ray : rays) widest = std::max(widest, rays[0].direction.cross(ray.direction).norm());
  if (widest < 1e-3) return std::nullopt;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Ray& ray : rays) mean += ray.origin / static_cast<double>(rays.size());
  Eigen::Vector3d point = Eigen::Vector3d::Zero();  // relative to the mean
  for (int round = 0; round < 4; ++round) {
    Eigen::Matrix3d a = Eigen::Matrix3d::Zero();
    Eigen::Vector3d b = Eigen::Vector3d::Zero();
    for (const Ray& ray : rays) {
      const double depth = round == 0 ? 1 : (point + mean - ray.origin).norm();
      const Eigen::Matrix3d across =
          (Eigen::Matrix3d::Identity() - ray.direction * ray.direction.transpose()) * (ray.weight / (depth * depth));
      a += across, b += across * (ray.origin - mean);
    }
    point = a.ldlt().solve(b);
  }
  if (!point.allFinite()) return std::nullopt;
  return Eigen::Vector3d(point + mean);
}

std::vector<geometry::Projector> Projectors(const CheckWork& work) {
  std::vector<geometry::Projector> projectors;
  for (const geometry::Camera& camera : work.problem.cameras) projectors.emplace_back(camera);
  return projectors;
}

/// Triangulated corners of one board at one instant, by id.
std::map<int, Eigen::Vector3d> Corners(const CheckWork& work, const std::vector<int>& views,
                                       const std::vector<geometry::Projector>& projectors) {
  std::map<int, std::vector<Ray>> rays;
  for (const int v : views) {
    const View& view = work.problem.views[static_cast<size_t>(v)];
    const size_t c = static_cast<size_t>(view.camera_idx);
    const geometry::Rigid3 world_from_cam = Inverse(work.rig.cameras[c].cam_from_world);
    for (Eigen::Index i = 0; i < view.size(); ++i) {
      const geometry::Unprojection ray = projectors[c].Unproject(view.px.col(i));
      if (view.weights[i] <= 0 || ray.status != Status::kOk) continue;
      const double focal = work.problem.cameras[c].fx();
      rays[view.corner_ids[static_cast<size_t>(i)]].push_back(
          {world_from_cam.translation, world_from_cam.rotation * ray.ray_in_cam, view.weights[i] * focal * focal});
    }
  }
  std::map<int, Eigen::Vector3d> corners;
  for (const auto& [id, seen] : rays) {
    if (seen.size() < 2) continue;
    if (const auto point = Intersect(seen)) corners[id] = *point;
  }
  return corners;
}

struct Lengths {
  std::vector<double> edges, pairs;  // errors, metres
};

void Append(const std::map<int, Eigen::Vector3d>& corners, const Eigen::Matrix3Xd& truth, double edge_m, Lengths* lengths) {
  for (auto a = corners.begin(); a != corners.end(); ++a) {
    for (auto b = std::next(a); b != corners.end(); ++b) {
      const double expected = (truth.col(a->first) - truth.col(b->first)).norm();
      const double error = (a->second - b->second).norm() - expected;
      if (lengths->pairs.size() < kMaxPairs) lengths->pairs.push_back(error);
      if (expected < 1.01 * edge_m && lengths->edges.size() < kMaxPairs) lengths->edges.push_back(error);
    }
  }
}

/// Smallest distance between two corners of a board.
double EdgeOf(const Eigen::Matrix3Xd& corners) {
  double smallest = std::numeric_limits<double>::infinity();
  for (Eigen::Index i = 0; i < corners.cols(); ++i) {
    for (Eigen::Index j = i + 1; j < corners.cols(); ++j)
      smallest = std::min(smallest, (corners.col(i) - corners.col(j)).norm());
  }
  return smallest;
}

void Summarise(const std::vector<double>& errors_m, double* rms_mm, double* bias_mm, double* median_mm) {
  std::vector<double> sizes;
  double squares = 0, sum = 0;
  for (const double error : errors_m) sizes.push_back(std::abs(error)), squares += error * error, sum += error;
  const double count = static_cast<double>(errors_m.size());
  *rms_mm = 1e3 * std::sqrt(squares / count);  // NaN for none
  *bias_mm = 1e3 * sum / count;
  if (median_mm) *median_mm = 1e3 * Median(sizes);
}

}  // namespace

BoardMetrics MeasureLengths(const std::vector<Board>& boards, const CheckWork& work) {
  const std::vector<geometry::Projector> projectors = Projectors(work);
  std::vector<Eigen::Matrix3Xd> truths;
  std::vector<double> edges;
  for (const Board& board : boards) {
    truths.push_back(CornersInBoard(board));
    edges.push_back(EdgeOf(truths.back()));
  }
  Lengths lengths;
  for (size_t b = 0; b < work.all_views_of_board.size(); ++b) {
    if (work.all_views_of_board[b].empty()) continue;
    const size_t kind = static_cast<size_t>(work.problem.views[static_cast<size_t>(work.all_views_of_board[b][0])].board);
    Append(Corners(work, work.all_views_of_board[b], projectors), truths[kind], edges[kind], &lengths);
  }
  BoardMetrics metrics;
  Summarise(lengths.edges, &metrics.edge_rms_mm, &metrics.edge_bias_mm, &metrics.edge_median_mm);
  Summarise(lengths.pairs, &metrics.pair_rms_mm, &metrics.pair_bias_mm, nullptr);
  return metrics;
}

double MeasureScale(const std::vector<Board>& boards, const CheckWork& work) {
  constexpr size_t kMinCorners = 6;
  const std::vector<geometry::Projector> projectors = Projectors(work);
  std::map<std::pair<int, int>, std::vector<double>> scales;  // by pair of cameras
  for (const std::vector<int>& views : work.all_views_of_board) {
    for (size_t i = 0; i < views.size(); ++i) {
      for (size_t j = i + 1; j < views.size(); ++j) {
        const View &a = work.problem.views[static_cast<size_t>(views[i])],
                   &b = work.problem.views[static_cast<size_t>(views[j])];
        const auto corners = Corners(work, {views[i], views[j]}, projectors);
        if (corners.size() < kMinCorners) continue;
        const Eigen::Matrix3Xd truth = CornersInBoard(boards[static_cast<size_t>(a.board)]);
        Eigen::Matrix3Xd on_board(3, static_cast<Eigen::Index>(corners.size())), in_world = on_board;
        Eigen::Index n = 0;
        for (const auto& [id, x] : corners) on_board.col(n) = truth.col(id), in_world.col(n++) = x;
        const geometry::Alignment alignment = geometry::AlignPoints(on_board, in_world, true);
        if (alignment.status == Status::kOk) scales[{a.camera_idx, b.camera_idx}].push_back(alignment.scale);
      }
    }
  }
  std::vector<double> pairs;
  for (const auto& [cameras, values] : scales) pairs.push_back(Median(values));
  if (pairs.empty()) return 1;
  std::sort(pairs.begin(), pairs.end(), [](double a, double b) { return std::abs(a - 1) < std::abs(b - 1); });
  return pairs[(pairs.size() - 1) / 3];
}

}  // namespace mvstudio::calib::internal
