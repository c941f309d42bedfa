#include "calib/rig/board_metrics.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "core/check.h"
#include "core/statistics.h"
#include "geometry/rig/rig.h"
#include "triangulate/point/linear.h"
#include "triangulate/point/refine.h"

namespace mvstudio::calib {
namespace {

using Eigen::Index;

constexpr double kMinParallaxRad = 0.01;  // rays that meet at less say more of the noise than of lengths
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

/// The cameras at the time of a frame. One with a time offset is placed so that the board, before its motion, looks as it
/// did to it.
triangulate::PreparedRig RigAt(int frame, const RigState& state) {
  geometry::Rig rig;
  for (size_t c = 0; c < state.cameras.size(); ++c) {
    const geometry::Rigid3 motion = BoardMotion(static_cast<int>(c), frame, state);
    rig.cameras.push_back({state.cameras[c], state.cam_from_world[c] * motion, std::nullopt, std::nullopt});
  }
  return triangulate::Prepare(rig);
}

bool WideEnough(const std::vector<triangulate::View>& views, double min_parallax_rad) {
  double widest = 0;
  for (const triangulate::View& view : views) widest = std::max(widest, views[0].ray_in_local.cross(view.ray_in_local).norm());
  return widest >= min_parallax_rad;
}

/// Of the absolute values; the mean of the middle two when their number is even.
double MedianAbs(std::vector<double> values) {
  for (double& value : values) value = std::abs(value);
  return LinearQuantile(std::move(values), 0.5);
}

struct Errors {
  std::vector<double> edges_mm, pairs_mm, pixels;
};

/// Measured minus true length of a pair of corners.
double LengthError(const Eigen::Matrix3Xd& corners, const CornerCloud& cloud, int a, int b) {
  return 1e3 * ((cloud.at(a) - cloud.at(b)).norm() - (corners.col(a) - corners.col(b)).norm());
}

void MeasureEdges(const Eigen::Matrix3Xd& corners, const std::vector<std::pair<int, int>>& neighbours, const CornerCloud& cloud,
                  Errors* errors) {
  for (const auto& [a, b] : neighbours) {
    if (cloud.count(a) && cloud.count(b)) errors->edges_mm.push_back(LengthError(corners, cloud, a, b));
  }
}

void MeasurePairs(const Eigen::Matrix3Xd& corners, const CornerCloud& cloud, Errors* errors) {
  for (auto a = cloud.begin(); a != cloud.end(); ++a) {
    for (auto b = std::next(a); b != cloud.end(); ++b)
      errors->pairs_mm.push_back(LengthError(corners, cloud, a->first, b->first));
  }
}

/// The corners of one board in one frame, and by how much each is off: the median of its lengths' absolute errors.
struct MeasuredBoard {
  int board = 0;
  CornerCloud cloud;
  std::map<int, double> off_mm = {};
};

MeasuredBoard MeasureBoard(int board, const Eigen::Matrix3Xd& corners, CornerCloud cloud) {
  MeasuredBoard measured{board, std::move(cloud)};
  for (const auto& [a, at] : measured.cloud) {
    std::vector<double> errors;
    for (const auto& [b, other] : measured.cloud) {
      if (b != a) errors.push_back(std::abs(LengthError(corners, measured.cloud, a, b)));
    }
    if (!errors.empty()) measured.off_mm[a] = UpperMedian(std::move(errors));
  }
  return measured;
}

double MedianOff(const std::vector<const MeasuredBoard*>& boards) {
  std::vector<double> off;
  for (const MeasuredBoard* board : boards) {
    for (const auto& [id, value] : board->off_mm) off.push_back(value);
  }
  return UpperMedian(std::move(off), 0);
}

/// Takes corners away that are off by far more than the others of their board in this frame and than corners in general: one
/// wrong detection. A board whose corners are off together keeps them. Returns their number.
int RemoveStrays(const Eigen::Matrix3Xd& corners, double typical_mm, MeasuredBoard* measured) {
  constexpr double kStray = 8, kNothing = 1e-5;  // of the board's size: rounding
  const double size_mm = 1e3 * (corners.rowwise().maxCoeff() - corners.rowwise().minCoeff()).norm();
  const double limit = kStray * std::max({typical_mm, MedianOff({measured}), kNothing * size_mm});
  int count = 0;
  for (const auto& [id, value] : measured->off_mm) {
    if (!(value > limit)) continue;
    measured->cloud.erase(id), ++count;
  }
  return count;
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
  for (int id = 0; id < board.num_corners(); ++id) {
    const int col = id % board.cols, row = id % board.num_side_corners() / board.cols;
    if (col + 1 < board.cols) pairs.emplace_back(id, id + 1);
    if (row + 1 < board.rows) pairs.emplace_back(id, id + board.cols);
  }
  return pairs;
}

CornerCloud TriangulateCorners(const triangulate::PreparedRig& rig, const CornerObservations& observations,
                               double min_parallax_rad, std::vector<double>* errors_px) {
  CornerCloud cloud;
  for (const auto& [id, seen] : observations) {
    Status rejected = Status::kOk;
    const std::vector<triangulate::View> views = triangulate::MakeViews(rig, seen, &rejected);
    const triangulate::LinearPoint start = triangulate::WeightedLinear(views);
    if (start.status != Status::kOk || !WideEnough(views, min_parallax_rad)) continue;
    const triangulate::Refinement point = triangulate::Refine(views, start.x_in_local);
    if (point.status != Status::kOk && point.status != Status::kNotConverged) continue;
    cloud[id] = rig.origin_in_world + point.x_in_local;
    if (!errors_px) continue;
    for (const triangulate::View& view : views)
      errors_px->push_back(view.sigma_px * triangulate::WhitenedResidual(view, point.x_in_local));
  }
  return cloud;
}

BoardMetrics ComputeBoardMetrics(const std::vector<Board>& boards, const std::vector<View>& views, const RigState& state) {
  std::map<std::pair<int, int>, CornerObservations> observations;  // by frame and board
  for (const View& view : views) {
    MVS_CHECK(view.board >= 0 && view.board < static_cast<int>(boards.size()), "board " << view.board);
    CornerObservations& of_board = observations[{view.frame, view.board}];
    for (Index i = 0; i < view.size(); ++i) of_board[view.corner_ids[i]].push_back({view.camera_idx, view.px.col(i), 1, 1});
  }
  std::vector<std::vector<std::pair<int, int>>> neighbours;
  std::vector<Eigen::Matrix3Xd> corners;
  for (const Board& board : boards) neighbours.push_back(NeighbouringCorners(board)), corners.push_back(CornersInBoard(board));
  BoardMetrics metrics;
  Errors errors;
  std::set<int> frames;
  std::vector<MeasuredBoard> measured;
  const bool moving = !state.time_offset_frames.empty();
  triangulate::PreparedRig rig;
  for (const auto& [place, of_board] : observations) {
    if (moving || rig.cameras.empty()) rig = RigAt(place.first, state);
    CornerCloud cloud = TriangulateCorners(rig, of_board, kMinParallaxRad, &errors.pixels);
    if (!cloud.empty()) frames.insert(place.first);
    metrics.num_points += static_cast<int>(cloud.size());
    measured.push_back(MeasureBoard(place.second, corners[place.second], std::move(cloud)));
  }
  std::vector<const MeasuredBoard*> all;
  for (const MeasuredBoard& each : measured) all.push_back(&each);
  const double typical_mm = MedianOff(all);
  for (MeasuredBoard& each : measured) {
    MeasureEdges(corners[each.board], neighbours[each.board], each.cloud, &errors);
    metrics.num_stray_points += RemoveStrays(corners[each.board], typical_mm, &each);
    MeasurePairs(corners[each.board], each.cloud, &errors);
  }
  metrics.edge_rms_mm = Rms(errors.edges_mm), metrics.edge_median_mm = MedianAbs(errors.edges_mm);
  metrics.edge_bias_mm = Mean(errors.edges_mm);
  metrics.pair_rms_mm = Rms(errors.pairs_mm), metrics.pair_bias_mm = Mean(errors.pairs_mm);
  metrics.reprojection_rms_px = Rms(errors.pixels), metrics.reprojection_median_px = MedianAbs(errors.pixels);
  metrics.num_frames = static_cast<int>(frames.size()), metrics.num_edges = static_cast<int>(errors.edges_mm.size());
  return metrics;
}

}  // namespace mvstudio::calib
