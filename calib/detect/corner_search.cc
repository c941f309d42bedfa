#include "calib/detect/corner_search.h"

#include <algorithm>
#include <cmath>
#include <opencv2/aruco.hpp>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "calib/board/apriltag.h"
#include "calib/board/charuco_layout.h"
#include "calib/board/homography.h"
#include "calib/detect/marker_agreement.h"
#include "core/check.h"

namespace mvstudio::calib {
namespace {

cv::Mat Wrap(const Image& grey) { return {grey.height, grey.width, CV_8UC1, const_cast<uint8_t*>(grey.pixels.data())}; }

Eigen::Vector2d ToEigen(const cv::Point2f& p) { return {p.x, p.y}; }

bool FindChessboard(const cv::Mat& grey, cv::Size size, ChessboardSearch how, std::vector<cv::Point2f>* corners) {
  const int classic = cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_NORMALIZE_IMAGE;
  if (how != ChessboardSearch::kSectors) {
    if (cv::findChessboardCorners(grey, size, *corners, classic | cv::CALIB_CB_FAST_CHECK)) return true;
    if (how == ChessboardSearch::kFast) return false;
    if (cv::findChessboardCorners(grey, size, *corners, classic)) return true;
  }
  const int sectors = cv::CALIB_CB_EXHAUSTIVE | cv::CALIB_CB_ACCURACY | cv::CALIB_CB_NORMALIZE_IMAGE;
  cv::setRNGSeed(1);  // otherwise it depends on what this thread searched before
  return cv::findChessboardCornersSB(grey, size, *corners, sectors);
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

/// How much brighter the squares that should be white on `board` are than those that should be black, grey levels.
double Brighter(const Board& board, const Image& grey, const Grid& grid) {
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
  return white / std::max(1, num_white) - black / std::max(1, num_black);
}

/// Corner (col, row) is the one that was (row, rows - 1 - col): a quarter turn of a grid of as many columns as rows.
Grid QuarterRotated(const Grid& grid) {
  Grid rotated = grid;
  for (int row = 0; row < grid.rows; ++row) {
    for (int col = 0; col < grid.cols; ++col) rotated.px[row * grid.cols + col] = grid.At(row, grid.rows - 1 - col);
  }
  return rotated;
}

/// Renumbers so that x cross y points away from the viewer, the colours are those of the board, and x points to the right as
/// far as both allow. False when the colours are those of the board in no turn.
bool Orient(const Board& board, const Image& grey, Grid* grid) {
  const Eigen::Vector2d x = grid->At(grid->cols - 1, 0) - grid->At(0, 0), y = grid->At(0, grid->rows - 1) - grid->At(0, 0);
  if (x.x() * y.y() - x.y() * y.x() < 0) {
    for (int row = 0; row < grid->rows; ++row) {
      std::reverse(grid->px.begin() + row * grid->cols, grid->px.begin() + (row + 1) * grid->cols);
    }
  }
  std::vector<Grid> turns = {*grid, *grid};
  std::reverse(turns[1].px.begin(), turns[1].px.end());
  if (grid->cols == grid->rows) {
    for (int half = 0; half < 2; ++half) turns.push_back(QuarterRotated(turns[static_cast<size_t>(half)]));
  }
  const auto rightward = [](const Grid& g) { return (g.At(g.cols - 1, 0) - g.At(0, 0)).normalized().x(); };
  std::vector<Grid> fitting;
  for (const Grid& rotated : turns) {
    const double brighter = Brighter(board, grey, rotated);
    if (board.inverted ? brighter <= 0 : brighter >= 0) fitting.push_back(rotated);
  }
  const std::vector<Grid>& chosen = fitting.empty() ? turns : fitting;
  *grid = *std::max_element(chosen.begin(), chosen.end(),
                            [&](const Grid& a, const Grid& b) { return rightward(a) < rightward(b); });
  return !fitting.empty();
}

/// Adds the ArUco markers found at `scale` times the resolution to those found before.
void AddAruco(const Board& board, const cv::Mat& grey, double scale, FoundMarkers* markers) {
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
    markers->px.emplace(ids[i], px);
  }
}

/// The width of border that more of the board's tags have.
int CommonBorder(const Board& board, const std::vector<Tag>& tags) {
  int votes = 0;
  for (const Tag& tag : tags) {
    const int n = tag.id - board.first_tag;
    if (n >= 0 && n < board.cols * board.rows && tag.hamming == 0) votes += tag.border == 2 ? 1 : -1;
  }
  return votes == 0 ? board.tag_border : votes > 0 ? 2 : 1;
}

/// Every pixel as bright as the brightest of its 3 x 3 neighbours: parts the corners of tags from squares that touch them.
Image Thinned(const Image& grey) {
  Image thinned(grey.width, grey.height, 1);
  cv::Mat to = Wrap(thinned);
  cv::dilate(Wrap(grey), to, {});
  return thinned;
}

/// Adds the tags that are to be seen only when the black is thinned.
void AddTouchingTags(const TagFamily& family, const Image& grey, std::vector<Tag>* tags) {
  std::vector<Tag> added;
  for (const Tag& tag : FindTags(family, TagBorder::kEither, Thinned(grey))) {
    const bool known = std::any_of(tags->begin(), tags->end(), [&](const Tag& other) { return other.id == tag.id; });
    if (!known) added.push_back(tag);
  }
  tags->insert(tags->end(), added.begin(), added.end());
}

FoundMarkers FindAprilTags(const Board& board, const Image& grey) {
  const auto family = FindTagFamily(board.dictionary);
  MVS_CHECK(family, "family " << board.dictionary);
  const bool grid = board.kind == Board::Kind::kAprilGrid;
  const TagBorder border = grid ? TagBorder::kEither : board.tag_border == 2 ? TagBorder::kWide : TagBorder::kNarrow;
  std::vector<Tag> tags = FindTags(*family, border, grey);
  if (grid && !family->white_inside && static_cast<int>(tags.size()) < board.cols * board.rows) {
    AddTouchingTags(*family, grey, &tags);
  }
  const int cells = grid ? CommonBorder(board, tags) : board.tag_border;
  FoundMarkers found;
  std::map<int, int> seen;
  for (const Tag& tag : tags) {
    if (tag.border != cells) continue;
    found.px[tag.id] = tag.px;
    ++seen[tag.id];
  }
  for (const auto& [id, count] : seen) {
    if (count > 1) found.px.erase(id), ++found.num_repeated;
  }
  return found;
}

std::vector<Marker> PlaceMarkers(const Board& board, const FoundMarkers& found) {
  const std::vector<Square> squares = MarkerSquares(board);
  const double half = board.marker_m / (2 * board.square_m);
  std::vector<Marker> markers;
  for (const auto& [id, px] : found.px) {
    const int n = id - board.first_tag;
    if (n < 0 || n >= static_cast<int>(squares.size())) continue;
    Marker marker{squares[static_cast<size_t>(n)], 0, px, {}};
    const double x = marker.square.col - 0.5, y = marker.square.row - 0.5;
    marker.on_board << x - half, x + half, x + half, x - half, y - half, y - half, y + half, y + half;
    markers.push_back(marker);
  }
  return markers;
}

std::vector<Marker> PlaceTags(const Board& board, const FoundMarkers& found) {
  const Eigen::Matrix3Xd corners = CornersInBoard(board) / board.square_m;
  std::vector<Marker> markers;
  for (const auto& [id, px] : found.px) {
    const int n = id - board.first_tag;
    if (n < 0 || n >= board.cols * board.rows) continue;
    markers.push_back({{}, 4 * n, px, corners.middleCols<4>(4 * n).topRows<2>()});
  }
  return markers;
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

CornerGuess GuessAt(const Eigen::Matrix3d& homography, int corner_id, const Eigen::Vector2d& at) {
  const auto step = [&](double x, double y) { return MapPoint(homography, at + Eigen::Vector2d(x, y)); };
  return {corner_id, step(0, 0), step(0.5, 0) - step(-0.5, 0), step(0, 0.5) - step(0, -0.5)};
}

void GuessTagCorners(const Marker& tag, std::vector<CornerGuess>* guesses) {
  const auto homography = FitHomography(tag.on_board, tag.px);
  if (!homography) return;
  for (int k = 0; k < 4; ++k) guesses->push_back(GuessAt(*homography, tag.first_id + k, tag.on_board.col(k)));
}

void GuessCharucoCorners(const Board& board, const std::vector<Marker>& markers, std::vector<CornerGuess>* guesses) {
  for (int i = 0; i < board.num_corners(); ++i) {
    const int col = i % board.cols, row = i / board.cols;
    if (!HasMarkerBeside(markers, col, row)) continue;
    const Eigen::Vector2d at(col, row);
    const auto homography = LocalHomography(markers, at);
    if (homography) guesses->push_back(GuessAt(*homography, i, at));
  }
}

}  // namespace

ChessboardFind SearchChessboard(const Board& board, const Image& grey, ChessboardSearch how) {
  std::vector<cv::Point2f> corners;
  if (!FindChessboard(Wrap(grey), {board.cols, board.rows}, how, &corners)) return {};
  if (static_cast<int>(corners.size()) != board.num_corners()) return {};
  Grid grid{board.cols, board.rows, {}};
  for (const cv::Point2f& corner : corners) grid.px.push_back(ToEigen(corner));
  ChessboardFind found;
  found.exchanged = !Orient(board, grey, &grid);
  for (int i = 0; i < board.num_corners(); ++i) {
    const int col = i % board.cols, row = i / board.cols;
    found.guesses.push_back({i, grid.px[i], AlongX(grid, col, row), AlongY(grid, col, row)});
  }
  return found;
}

std::string MarkerKey(const Board& board) {
  if (!board.has_tags())
    return board.dictionary + (board.inverted ? " inverted" : "") + " " + std::to_string(MarkerSquares(board).size());
  if (board.kind == Board::Kind::kTag) return "tag" + board.dictionary + (board.tag_border == 2 ? " wide" : "");
  return "grid" + board.dictionary + " " + std::to_string(board.first_tag) + " " + std::to_string(board.cols * board.rows);
}

FoundMarkers FindMarkers(const Board& board, const Image& grey, bool enlarge) {
  if (board.has_tags()) return FindAprilTags(board, grey);
  FoundMarkers found;
  AddAruco(board, Wrap(grey), 1, &found);
  if (enlarge && 2 * found.px.size() < MarkerSquares(board).size()) AddAruco(board, Wrap(grey), 2, &found);
  return found;
}

MarkerSearch PlaceCorners(const Board& board, const FoundMarkers& found) {
  const std::vector<Marker> placed = board.has_tags() ? PlaceTags(board, found) : PlaceMarkers(board, found);
  const std::vector<Marker> markers = AgreeingMarkers(placed);
  MarkerSearch result;
  result.num_markers = static_cast<int>(placed.size());
  result.num_agreeing = static_cast<int>(markers.size());
  if (board.has_tags()) {
    for (const Marker& tag : markers) GuessTagCorners(tag, &result.guesses);
  } else {
    GuessCharucoCorners(board, markers, &result.guesses);
  }
  return result;
}

}  // namespace mvstudio::calib
