#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <utility>

#include "calib/bundle/board_shape.h"
#include "calib/check/check_steps.h"
#include "core/statistics.h"
#include "geometry/rig/alignment.h"

namespace mvstudio::calib::internal {
namespace {

constexpr size_t kMaxPairs = 2000000;  ///< lengths that are kept of one kind; more say nothing new

constexpr double kMinParallaxRad = 1e-3;

triangulate::PreparedRig Prepared(const CheckWork& work) {
  geometry::Rig rig;
  for (size_t c = 0; c < work.problem.cameras.size(); ++c)
    rig.cameras.push_back({work.problem.cameras[c], work.rig.cameras[c].cam_from_world, std::nullopt, std::nullopt});
  return triangulate::Prepare(rig);
}

/// Triangulated corners of one board at one time step, without dropped ones.
CornerCloud Corners(const CheckWork& work, const std::vector<int>& views, const triangulate::PreparedRig& rig) {
  CornerObservations observations;
  for (const int v : views) {
    const View& view = work.problem.views[static_cast<size_t>(v)];
    for (Eigen::Index i = 0; i < view.size(); ++i) {
      if (view.weights[i] <= 0) continue;
      observations[view.corner_ids[static_cast<size_t>(i)]].push_back(
          {view.camera_idx, view.px.col(i), 1 / std::sqrt(view.weights[i]), 1});
    }
  }
  return TriangulateCorners(rig, observations, kMinParallaxRad);
}

struct Lengths {
  std::vector<double> edges, pairs;  // errors, metres
};

void Append(const CornerCloud& corners, const Eigen::Matrix3Xd& truth, double edge_m, Lengths* lengths) {
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
  double sum = 0;
  for (const double error : errors_m) sizes.push_back(std::abs(error)), sum += error;
  *rms_mm = 1e3 * Rms(errors_m);
  *bias_mm = 1e3 * sum / static_cast<double>(errors_m.size());  // NaN for none
  if (median_mm) *median_mm = 1e3 * UpperMedian(sizes);
}

}  // namespace

BoardMetrics MeasureLengths(const std::vector<Board>& boards, const CheckWork& work) {
  const triangulate::PreparedRig rig = Prepared(work);
  std::vector<Eigen::Matrix3Xd> truths;
  std::vector<double> edges;
  for (const Board& board : boards) {
    truths.push_back(ShapedCorners(board, work.rig.boards));
    edges.push_back(EdgeOf(truths.back()));
  }
  Lengths lengths;
  for (size_t b = 0; b < work.all_views_of_board.size(); ++b) {
    if (work.all_views_of_board[b].empty()) continue;
    const size_t kind = static_cast<size_t>(work.problem.views[static_cast<size_t>(work.all_views_of_board[b][0])].board);
    Append(Corners(work, work.all_views_of_board[b], rig), truths[kind], edges[kind], &lengths);
  }
  BoardMetrics metrics;
  Summarise(lengths.edges, &metrics.edge_rms_mm, &metrics.edge_bias_mm, &metrics.edge_median_mm);
  Summarise(lengths.pairs, &metrics.pair_rms_mm, &metrics.pair_bias_mm, nullptr);
  return metrics;
}

double MeasureScale(const std::vector<Board>& boards, const CheckWork& work) {
  constexpr size_t kMinCorners = 6;
  const triangulate::PreparedRig rig = Prepared(work);
  std::map<std::pair<int, int>, std::vector<double>> scales;  // by pair of cameras
  for (const std::vector<int>& views : work.all_views_of_board) {
    for (size_t i = 0; i < views.size(); ++i) {
      for (size_t j = i + 1; j < views.size(); ++j) {
        const View &a = work.problem.views[static_cast<size_t>(views[i])],
                   &b = work.problem.views[static_cast<size_t>(views[j])];
        const auto corners = Corners(work, {views[i], views[j]}, rig);
        if (corners.size() < kMinCorners) continue;
        const Eigen::Matrix3Xd truth = ShapedCorners(boards[static_cast<size_t>(a.board)], work.rig.boards);
        Eigen::Matrix3Xd on_board(3, static_cast<Eigen::Index>(corners.size())), in_world = on_board;
        Eigen::Index n = 0;
        for (const auto& [id, x] : corners) on_board.col(n) = truth.col(id), in_world.col(n++) = x;
        const geometry::Alignment alignment = geometry::AlignPoints(on_board, in_world, true);
        if (alignment.status == Status::kOk) scales[{a.camera_idx, b.camera_idx}].push_back(alignment.scale);
      }
    }
  }
  std::vector<double> pairs;
  for (const auto& [cameras, values] : scales) pairs.push_back(UpperMedian(values));
  if (pairs.empty()) return std::numeric_limits<double>::quiet_NaN();
  std::sort(pairs.begin(), pairs.end(), [](double a, double b) { return std::abs(a - 1) < std::abs(b - 1); });
  return pairs[(pairs.size() - 1) / 3];
}

}  // namespace mvstudio::calib::internal
