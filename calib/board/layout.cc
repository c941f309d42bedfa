#include "calib/board/layout.h"

#include <algorithm>
#include <limits>

#include "calib/board/homography.h"
#include "core/format.h"
#include "core/statistics.h"

namespace mvstudio::calib {
namespace {

constexpr size_t kMaxViews = 24;
constexpr Eigen::Index kMinCorners = 12;
constexpr int kMaxCols = 60;
constexpr double kClear = 5, kMaxShare = 0.02;

bool IsRowByRow(const Board& board) {
  return board.kind == Board::Kind::kChessboard || board.kind == Board::Kind::kCharuco || board.kind == Board::Kind::kGrid ||
         board.kind == Board::Kind::kCircles;
}

/// Up to kMaxViews of the front, evenly: the back has the same columns and rows.
std::vector<const Detection*> ViewsOf(int board, int num_side_corners, const std::vector<Detection>& detections) {
  std::vector<const Detection*> all, some;
  for (const Detection& d : detections) {
    const bool usable = d.board_idx == board && d.points_px.cols() >= kMinCorners && d.points_px.allFinite();
    const auto on_back = [&](int id) { return id >= num_side_corners; };
    if (usable && std::none_of(d.corner_ids.begin(), d.corner_ids.end(), on_back)) all.push_back(&d);
  }
  for (size_t i = 0; i < std::min(kMaxViews, all.size()); ++i)
    some.push_back(all[i * all.size() / std::min(kMaxViews, all.size())]);
  return some;
}

double Extent(const Detection& d) { return (d.points_px.rowwise().maxCoeff() - d.points_px.rowwise().minCoeff()).norm(); }

/// Root mean square distance of the corners from the image of a plane with `cols` corners per row. With `mirrored_cols`
/// the corners were numbered in the opposite direction within rows of this length.
double DistancePx(const Detection& d, int cols, int mirrored_cols) {
  constexpr double kNone = std::numeric_limits<double>::infinity();
  Eigen::Matrix2Xd grid(2, d.points_px.cols());
  for (Eigen::Index i = 0; i < grid.cols(); ++i) {
    int id = d.corner_ids[static_cast<size_t>(i)];
    if (mirrored_cols > 0) id += mirrored_cols - 1 - 2 * (id % mirrored_cols);
    grid.col(i) << id % cols, id / cols;
  }
  if (grid.row(0).maxCoeff() == grid.row(0).minCoeff() || grid.row(1).maxCoeff() == grid.row(1).minCoeff()) return kNone;
  const auto homography = FitHomography(grid, d.points_px);
  if (!homography) return kNone;
  double sum = 0;
  for (Eigen::Index i = 0; i < grid.cols(); ++i) sum += (MapPoint(*homography, grid.col(i)) - d.points_px.col(i)).squaredNorm();
  return std::isfinite(sum) ? std::sqrt(sum / static_cast<double>(grid.cols())) : kNone;
}

double MedianDistance(const std::vector<const Detection*>& views, int cols, int mirrored_cols) {
  std::vector<double> distances;
  for (const Detection* d : views) distances.push_back(DistancePx(*d, cols, mirrored_cols));
  return UpperMedian(std::move(distances));
}

std::optional<LayoutFault> FaultOf(int index, const Board& board, const std::vector<const Detection*>& views) {
  std::vector<double> extents;
  int last_id = 0;
  for (const Detection* d : views) {
    extents.push_back(Extent(*d));
    last_id = std::max(last_id, *std::max_element(d->corner_ids.begin(), d->corner_ids.end()));
  }
  const double near = kMaxShare * UpperMedian(std::move(extents));
  LayoutFault fault{index, board.cols, board.rows, board.cols, board.rows, MedianDistance(views, board.cols, 0), 0, ""};
  if (!(fault.told_px > near)) return std::nullopt;
  fault.found_px = std::numeric_limits<double>::infinity();
  for (int cols = 2; cols <= std::min(kMaxCols, last_id); ++cols) {
    // Corners that ran mirrored as described were renumbered when they were read.
    const double distance = std::min(MedianDistance(views, cols, 0), MedianDistance(views, cols, board.cols));
    if (distance < fault.found_px) fault.found_px = distance, fault.cols = cols, fault.rows = last_id / cols + 1;
  }
  const bool believed = fault.found_px <= near && kClear * fault.found_px < fault.told_px;
  if (!believed) return std::nullopt;
  Board mended = board;
  mended.cols = fault.cols, mended.rows = fault.rows;
  fault.mended = ToString(mended);
  return fault;
}

}  // namespace

std::string ToString(const LayoutFault& fault) {
  return Format(
      "the corners of board %d stand as on a board of %d columns and %d rows, not of %d columns and %d rows as described: they "
      "lie within %.2g px of a plane's image instead of %.3g px%s; give option 'board' %s",
      fault.board, fault.cols, fault.rows, fault.told_cols, fault.told_rows, fault.found_px, fault.told_px,
      fault.cols == fault.told_rows && fault.rows == fault.told_cols ? ": columns and rows are exchanged" : "",
      fault.mended.c_str());
}

std::optional<LayoutFault> FindLayoutFault(const std::vector<Board>& boards, const std::vector<Detection>& detections) {
  constexpr size_t kMinViews = 3;
  for (int b = 0; b < static_cast<int>(boards.size()); ++b) {
    const std::vector<const Detection*> views = ViewsOf(b, boards[static_cast<size_t>(b)].num_side_corners(), detections);
    if (!IsRowByRow(boards[b]) || views.size() < kMinViews) continue;
    if (const auto fault = FaultOf(b, boards[b], views)) return fault;
  }
  return std::nullopt;
}

}  // namespace mvstudio::calib
