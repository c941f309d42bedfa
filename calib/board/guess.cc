#include "calib/board/guess.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <functional>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <set>

#include "calib/board/charuco_layout.h"
#include "calib/board/homography.h"
#include "core/statistics.h"

namespace mvstudio::calib {
namespace {

constexpr int kMaxCols = 30;
constexpr int kLeastMarkers = 5;               // of an image, for its layout to be told
constexpr double kMaxMisplaced = 0.2;          // of a marker's side
constexpr double kMaxSideRatio = 1.4;          // of a marker's side to the median of its image, on the board
constexpr int kLeastSeenShare = 4;             // one marker of so many must be seen, or the board is larger than anybody saw
constexpr int kSidesPx[] = {800, 1600, 3200};  // longer side of the image, coarse to fine

using CentreOf = std::function<Eigen::Vector2d(int)>;

/// How well a layout explains the markers of all images.
struct LayoutFit {
  int num_placed = 0;                // markers where the layout puts them
  int largest_id = -1;               // of a placed marker
  std::vector<double> marker_sides;  // in steps of the layout, for every marker that is in its place
};

/// Without the ids that would make a board of which hardly anything was seen: those of clutter read as a marker.
std::vector<MarkersOfImage> WithoutStrayIds(std::vector<MarkersOfImage> images, int first_id) {
  std::set<int> ids;
  for (const MarkersOfImage& markers : images) {
    for (const auto& [id, px] : markers) ids.insert(id);
  }
  int largest = -1, count = 0;
  for (const int id : ids) {
    if (id - first_id + 1 <= kLeastSeenShare * ++count) largest = id;
  }
  for (MarkersOfImage& markers : images) markers.erase(markers.upper_bound(largest), markers.end());
  return images;
}

/// Mean side of a marker in steps of the layout.
double SideInLayout(const Eigen::Matrix3d& layout_from_px, const Eigen::Matrix<double, 2, 4>& px) {
  double sum = 0;
  for (int k = 0; k < 4; ++k)
    sum += (MapPoint(layout_from_px, px.col(k)) - MapPoint(layout_from_px, px.col((k + 1) % 4))).norm();
  return sum / 4;
}

void FitImage(const MarkersOfImage& markers, const CentreOf& centre_of, LayoutFit* fit) {
  if (static_cast<int>(markers.size()) < kLeastMarkers) return;
  Eigen::Matrix2Xd from(2, markers.size()), to(2, markers.size());
  int n = 0;
  for (const auto& [id, px] : markers) from.col(n) = centre_of(id), to.col(n++) = px.rowwise().mean();
  std::optional<Eigen::Matrix3d> homography;
  Eigen::VectorXd weights = Eigen::VectorXd::Ones(n);
  for (int round = 0; round < 5; ++round) {
    homography = FitHomography(from, to, weights);
    if (!homography) return;
    Eigen::VectorXd distances(n);
    for (int i = 0; i < n; ++i) distances[i] = (MapPoint(*homography, from.col(i)) - to.col(i)).norm();
    weights = (1 + (distances / std::max(0.1, 2 * Median(distances))).array().square()).inverse();
  }
  const Eigen::Matrix3d back = homography->inverse();
  std::vector<double> all_sides, sides;
  for (const auto& [id, px] : markers) all_sides.push_back(SideInLayout(back, px));
  const double usual_side = Median(Eigen::Map<const Eigen::VectorXd>(all_sides.data(), n));
  int i = 0, largest_id = -1;
  for (const auto& [id, px] : markers) {
    const double side_px = (px.col(0) - px.col(2)).norm() / std::sqrt(2.0), side = all_sides[static_cast<size_t>(i)];
    const double off_px = (MapPoint(*homography, from.col(i++)) - px.rowwise().mean()).norm();
    if (off_px > kMaxMisplaced * side_px) continue;
    if (!(side < kMaxSideRatio * usual_side && usual_side < kMaxSideRatio * side)) continue;
    sides.push_back(side), largest_id = id;
  }
  const int placed = static_cast<int>(sides.size());
  if (placed < kLeastMarkers || 3 * placed < 2 * n) return;
  fit->num_placed += placed;
  fit->largest_id = std::max(fit->largest_id, largest_id);
  fit->marker_sides.insert(fit->marker_sides.end(), sides.begin(), sides.end());
}

LayoutFit FitLayout(const std::vector<MarkersOfImage>& images, const CentreOf& centre_of) {
  LayoutFit fit;
  for (const MarkersOfImage& markers : images) FitImage(markers, centre_of, &fit);
  return fit;
}

/// To a hundredth, or to a twentieth when that is as likely: the detectors' outlines are a fraction of a pixel off.
double RoundRatio(double ratio) {
  const double coarse = std::round(ratio * 20) / 20, fine = std::round(ratio * 100) / 100;
  return coarse > 0 && std::abs(ratio - coarse) < 0.021 ? coarse : fine;
}

int LargestId(const std::vector<MarkersOfImage>& images) {
  int largest = 0;
  for (const MarkersOfImage& markers : images) {
    if (!markers.empty()) largest = std::max(largest, markers.rbegin()->first);
  }
  return largest;
}

/// Centres of the markers of a board with `cols` columns of squares and as many rows as the ids need.
std::vector<Eigen::Vector2d> CharucoCentres(int cols, bool shifted, int count) {
  std::vector<Eigen::Vector2d> centres;
  for (int row = 0; static_cast<int>(centres.size()) < count; ++row) {
    for (int col = 0; col < cols; ++col) {
      if ((col + row + shifted) % 2 == 1) centres.emplace_back(col, row);
    }
  }
  return centres;
}

/// Rows of squares that markers 0 to `largest_id` need.
int RowsFor(int cols, bool shifted, int largest_id) {
  const auto centres = CharucoCentres(cols, shifted, largest_id + 1);
  const int rows = static_cast<int>(centres[largest_id].y()) + 1;
  return shifted && rows % 2 == 1 ? rows + 1 : rows;  // only boards with even rows are shifted
}

struct GridGuess {
  int num_placed = 0;
  std::optional<Board> board;
};

/// The first tag to count columns from, and the one below which no rows are added.
struct FirstTag {
  int columns_from = 0, rows_from = 0;
};

/// AprilGrids whose columns are counted from a tag. Rows that lie below `rows_from` as a whole are left out: the smallest grid
/// that explains the ids.
void TryGrids(const std::string& family, const std::vector<MarkersOfImage>& images, const FirstTag& from, int smallest,
              GridGuess* best) {
  const int first = from.columns_from;
  if (first > smallest) return;
  for (int cols = 2; cols <= kMaxCols; ++cols) {
    const LayoutFit fit =
        FitLayout(images, [&](int id) { return Eigen::Vector2d((id - first) % cols, -((id - first) / cols)); });
    if (fit.num_placed <= best->num_placed) continue;
    const double side = UpperMedian(fit.marker_sides, 0);
    if (side <= 0.1 || side >= 0.99) continue;
    Board board;
    board.kind = Board::Kind::kAprilGrid;
    board.dictionary = family;
    board.cols = cols;
    board.first_tag = first + std::max(0, from.rows_from - first) / cols * cols;
    board.rows = (fit.largest_id - board.first_tag) / cols + 1;
    board.square_m = 1;
    board.tag_spacing = RoundRatio(1 / side - 1);
    *best = {fit.num_placed, board};
  }
}

}  // namespace

std::optional<Board> GuessCharuco(const std::string& dictionary, const std::vector<MarkersOfImage>& all_images,
                                  const std::optional<Board>& hint) {
  const std::vector<MarkersOfImage> images = WithoutStrayIds(all_images, 0);
  const int largest = LargestId(images);
  int best_placed = 0;
  std::optional<Board> best;
  double side = 0;
  for (int cols = 3; cols <= kMaxCols; ++cols) {
    for (const bool shifted : {false, true}) {
      const auto centres = CharucoCentres(cols, shifted, largest + 1);
      const LayoutFit fit = FitLayout(images, [&](int id) { return centres[id]; });
      if (fit.num_placed <= best_placed) continue;
      best_placed = fit.num_placed;
      side = UpperMedian(fit.marker_sides, 0);
      Board board;
      board.kind = Board::Kind::kCharuco;
      board.dictionary = dictionary;
      board.cols = cols - 1;
      board.rows = std::max(2, RowsFor(cols, shifted, fit.largest_id) - 1);
      board.legacy = shifted;
      best = board;
    }
  }
  if (!best || side <= 0.05 || side >= 1) return std::nullopt;
  best->square_m = 1;
  best->marker_m = RoundRatio(side);
  const bool same = hint && hint->kind == Board::Kind::kCharuco && hint->cols == best->cols && hint->rows >= best->rows;
  if (same && (!best->legacy || hint->rows % 2 == 1)) best->rows = hint->rows;
  return best;
}

std::optional<Board> GuessAprilGrid(const std::string& family, const std::vector<MarkersOfImage>& all_images,
                                    const std::optional<Board>& hint) {
  int smallest = 1 << 30;
  for (const MarkersOfImage& markers : all_images) {
    if (!markers.empty()) smallest = std::min(smallest, markers.begin()->first);
  }
  const std::vector<MarkersOfImage> images = WithoutStrayIds(all_images, smallest);
  size_t num_markers = 0;
  for (const MarkersOfImage& markers : images) num_markers += markers.size();
  GridGuess best;
  const bool told =
      hint && hint->has_tags() && hint->first_tag <= smallest && LargestId(images) < hint->first_tag + hint->cols * hint->rows;
  if (told) TryGrids(family, images, {hint->first_tag, hint->first_tag}, smallest, &best);
  for (const int first : {0, smallest}) TryGrids(family, images, {first, smallest}, smallest, &best);
  // The first tags of the first row are hidden: the columns begin before the smallest id.
  for (int hidden = 1; hidden < kMaxCols && hidden <= smallest && 5 * static_cast<size_t>(best.num_placed) < 4 * num_markers;
       ++hidden)
    TryGrids(family, images, {smallest - hidden, smallest - hidden}, smallest, &best);
  return best.board;
}

std::optional<std::pair<int, int>> GuessChessboard(const Image& grey) {
  const cv::Mat image(grey.height, grey.width, CV_8UC1, const_cast<uint8_t*>(grey.pixels.data()));
  const int flags = cv::CALIB_CB_LARGER | cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_EXHAUSTIVE;
  std::optional<std::pair<int, int>> largest;
  double last_scale = 0;
  for (const int side_px : kSidesPx) {  // at one resolution the search often ends with a part of the board
    const double scale = std::min(1.0, static_cast<double>(side_px) / std::max(grey.width, grey.height));
    if (scale == last_scale) break;
    last_scale = scale;
    cv::Mat smaller = image, meta;
    if (scale < 1) cv::resize(image, smaller, {}, scale, scale, cv::INTER_AREA);
    std::vector<cv::Point2f> corners;
    cv::setRNGSeed(1);  // otherwise it depends on what this thread searched before
    if (!cv::findChessboardCornersSB(smaller, {3, 3}, corners, flags, meta) || meta.empty()) continue;
    if (!largest || meta.cols * meta.rows > largest->first * largest->second) largest = std::make_pair(meta.cols, meta.rows);
  }
  return largest;
}

}  // namespace mvstudio::calib
