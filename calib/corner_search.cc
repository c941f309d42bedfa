#include "calib/corner_search.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <opencv2/aruco.hpp>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "calib/charuco_layout.h"
#include "calib/homography.h"

namespace mvstudio::calib {
namespace {

cv::Mat Wrap(const Image& grey) { return {grey.height, grey.width, CV_8UC1, const_cast<uint8_t*>(grey.pixels.data())}; }

Eigen::Vector2d ToEigen(const cv::Point2f& p) { return {p.x, p.y}; }

bool FindChessboard(const cv::Mat& grey, cv::Size size, bool exact, std::vector<cv::Point2f>* corners) {
  const int classic = cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_NORMALIZE_IMAGE;
  if (cv::findChessboardCorners(grey, size, *corners, classic | cv::CALIB_CB_FAST_CHECK)) return true;
  if (!exact) return false;
  if (cv::findChessboardCorners(grey, size, *corners, classic)) return true;
  const int sector = cv::CALIB_CB_EXHAUSTIVE | cv::CALIB_CB_ACCURACY | cv::CALIB_CB_NORMALIZE_IMAGE;
  return cv::findChessboardCornersSB(grey, size, *corners, sector);
}

/// Corners as a grid, (rows x cols) row by row.
struct Grid {
  int cols = 0, rows = 0;
  std::vector<Eigen::Vector2d> px;
  const Eigen::Vector2d& At(int col, int row) const { return px[row * cols + col]; }
};

Eigen::Vector2d AlongX(const Grid& grid, int col, int row) {
  const int low = std::max(0, col - 1), high = std::min(grid.cols - 1, col + 1);
  return (grid.At(high, row) - grid.At(low, row)) / (high - low);
}

Eigen::Vector2d AlongY(const Grid& grid, int col, int row) {
  const int low = std::max(0, row - 1), high = std::min(grid.rows - 1, row + 1);
  return (grid.At(col, high) - grid.At(col, low)) / (high - low);
}

double MeanGrey(const Image& grey, const Eigen::Vector2d& center) {
  double sum = 0;
  int count = 0;
  for (int dv = -1; dv <= 1; ++dv) {
    for (int du = -1; du <= 1; ++du) {
      const int u = static_cast<int>(std::lround(center.x())) + du, v = static_cast<int>(std::lround(center.y())) + dv;
      if (u < 0 || v < 0 || u >= grey.width || v >= grey.height) continue;
      sum += *grey.Pixel(u, v), ++count;
    }
  }
  return count ? sum / count : 0;
}

/// True when the squares that should be black on `board` are darker than those that should be white.
bool ColoursFit(const Board& board, const Image& grey, const Grid& grid) {
  double black = 0, white = 0;
  int num_black = 0, num_white = 0;
  for (int row = 0; row + 1 < grid.rows; ++row) {
    for (int col = 0; col + 1 < grid.cols; ++col) {
      const Eigen::Vector2d center =
          (grid.At(col, row) + grid.At(col + 1, row) + grid.At(col, row + 1) + grid.At(col + 1, row + 1)) / 4;
      const double value = MeanGrey(grey, center);
      IsBlack(board, {col + 1, row + 1}) ? (black += value, ++num_black) : (white += value, ++num_white);
    }
  }
  return black * num_white <= white * num_black;
}

/// Renumbers so that x cross y points away from the viewer and the colours are those of the board.
void Orient(const Board& board, const Image& grey, Grid* grid) {
  const Eigen::Vector2d x = grid->At(grid->cols - 1, 0) - grid->At(0, 0), y = grid->At(0, grid->rows - 1) - grid->At(0, 0);
  if (x.x() * y.y() - x.y() * y.x() < 0) {
    for (int row = 0; row < grid->rows; ++row) {
      std::reverse(grid->px.begin() + row * grid->cols, grid->px.begin() + (row + 1) * grid->cols);
    }
  }
  if (!ColoursFit(board, grey, *grid)) std::reverse(grid->px.begin(), grid->px.end());
}

/// Corners of one marker, clockwise from its top left, with where they lie on the board in squares from corner (0, 0).
struct Marker {
  Square square;
  Eigen::Matrix<double, 2, 4> px, on_board;
};

using MarkerMap = std::map<int, Eigen::Matrix<double, 2, 4>>;

/// Adds the markers found at `scale` times the resolution to those found before.
void FindMarkers(const Board& board, const cv::Mat& grey, double scale, MarkerMap* markers) {
  auto parameters = cv::aruco::DetectorParameters::create();
  parameters->adaptiveThreshWinSizeMin = 3;
  parameters->adaptiveThreshWinSizeMax = scale > 1 ? 33 : 23;
  parameters->minMarkerPerimeterRate = 0.01;
  parameters->perspectiveRemovePixelPerCell = 6;
  cv::Mat resized = grey;
  if (scale != 1) cv::resize(grey, resized, {}, scale, scale, cv::INTER_CUBIC);
  std::vector<std::vector<cv::Point2f>> corners;
  std::vector<int> ids;
  cv::aruco::detectMarkers(resized, cv::aruco::getPredefinedDictionary(DictionaryIndex(board.dictionary)), corners, ids,
                           parameters);
  for (size_t i = 0; i < ids.size(); ++i) {
    Eigen::Matrix<double, 2, 4> px;
    for (int k = 0; k < 4; ++k) px.col(k) = ((ToEigen(corners[i][k]).array() + 0.5) / scale - 0.5).matrix();
    markers->emplace(ids[i], px);
  }
}

std::vector<Marker> PlaceMarkers(const Board& board, const MarkerMap& found) {
  const std::vector<Square> squares = MarkerSquares(board);
  const double half = board.marker_m / (2 * board.square_m);
  std::vector<Marker> markers;
  for (const auto& [id, px] : found) {
    if (id >= static_cast<int>(squares.size())) continue;
    Marker marker{squares[id], px, {}};
    const double x = marker.square.col - 0.5, y = marker.square.row - 0.5;
    marker.on_board << x - half, x + half, x + half, x - half, y - half, y - half, y + half, y + half;
    markers.push_back(marker);
  }
  return markers;
}

/// Drops markers whose centre is not where the others put it (a wrong id, or a marker that is not on this board).
std::vector<Marker> AgreeingMarkers(const std::vector<Marker>& markers) {
  if (markers.empty()) return markers;
  std::vector<cv::Point2f> from, to;
  for (const Marker& m : markers) {
    for (int k = 0; k < 4; ++k) from.emplace_back(m.on_board(0, k), m.on_board(1, k)), to.emplace_back(m.px(0, k), m.px(1, k));
  }
  double side = 0;
  for (const Marker& m : markers) side += (m.px.col(0) - m.px.col(2)).norm() / markers.size();
  cv::setRNGSeed(1);
  cv::Mat mask;
  const cv::Mat homography = cv::findHomography(from, to, cv::RANSAC, std::max(2.0, 0.35 * side), mask, 500);
  std::vector<Marker> kept;
  if (homography.empty()) return kept;
  for (size_t i = 0; i < markers.size(); ++i) {
    int votes = 0;
    for (int k = 0; k < 4; ++k) votes += mask.at<uint8_t>(static_cast<int>(4 * i + k)) != 0;
    if (votes >= 3) kept.push_back(markers[i]);
  }
  return kept;
}

/// Homography of the marker corners around board position `at`, the near ones with more weight.
std::optional<Eigen::Matrix3d> LocalHomography(const std::vector<Marker>& markers, const Eigen::Vector2d& at) {
  constexpr double kReach = 1.2, kFar = 3.2;  // squares
  Eigen::Matrix2Xd from(2, 4 * markers.size()), to(2, 4 * markers.size());
  Eigen::VectorXd weights(4 * markers.size());
  int n = 0;
  for (const Marker& m : markers) {
    const double distance = (m.on_board.rowwise().mean() - at).norm();
    if (distance > kFar) continue;
    from.middleCols(n, 4) = m.on_board, to.middleCols(n, 4) = m.px;
    weights.segment(n, 4).setConstant(std::exp(-distance * distance / (2 * kReach * kReach)));
    n += 4;
  }
  return FitHomography(from.leftCols(n), to.leftCols(n), weights.head(n));
}

bool HasMarkerBeside(const std::vector<Marker>& markers, int col, int row) {
  return std::any_of(markers.begin(), markers.end(), [&](const Marker& m) {
    return (m.square.col == col || m.square.col == col + 1) && (m.square.row == row || m.square.row == row + 1);
  });
}

}  // namespace

std::vector<CornerGuess> SearchChessboard(const Board& board, const Image& grey, bool exact) {
  std::vector<cv::Point2f> corners;
  if (!FindChessboard(Wrap(grey), {board.cols, board.rows}, exact, &corners)) return {};
  if (static_cast<int>(corners.size()) != board.num_corners()) return {};
  Grid grid{board.cols, board.rows, {}};
  for (const cv::Point2f& corner : corners) grid.px.push_back(ToEigen(corner));
  Orient(board, grey, &grid);
  std::vector<CornerGuess> guesses;
  for (int i = 0; i < board.num_corners(); ++i) {
    const int col = i % board.cols, row = i / board.cols;
    guesses.push_back({i, grid.px[i], AlongX(grid, col, row), AlongY(grid, col, row)});
  }
  return guesses;
}

CharucoSearch SearchCharuco(const Board& board, const Image& grey) {
  const size_t expected = MarkerSquares(board).size();
  MarkerMap found;
  FindMarkers(board, Wrap(grey), 1, &found);
  if (2 * found.size() < expected) FindMarkers(board, Wrap(grey), 2, &found);
  const std::vector<Marker> placed = PlaceMarkers(board, found);
  const std::vector<Marker> markers = AgreeingMarkers(placed);
  CharucoSearch result;
  result.num_markers = static_cast<int>(placed.size());
  result.num_agreeing = static_cast<int>(markers.size());
  for (int i = 0; i < board.num_corners(); ++i) {
    const int col = i % board.cols, row = i / board.cols;
    if (!HasMarkerBeside(markers, col, row)) continue;
    const Eigen::Vector2d at(col, row);
    const auto homography = LocalHomography(markers, at);
    if (!homography) continue;
    const auto step = [&](double x, double y) { return MapPoint(*homography, at + Eigen::Vector2d(x, y)); };
    result.guesses.push_back({i, step(0, 0), step(0.5, 0) - step(-0.5, 0), step(0, 0.5) - step(0, -0.5)});
  }
  return result;
}

}  // namespace mvstudio::calib
