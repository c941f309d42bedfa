#include "calib/board/print.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <opencv2/aruco.hpp>

#include "calib/board/apriltag.h"
#include "calib/board/charuco_layout.h"
#include "calib/board/sets.h"
#include "core/check.h"
#include "core/error.h"

namespace mvstudio::calib {
namespace {

void Add(double x, double y, double width, double height, BoardPrint* print) {
  if (width > 0 && height > 0) print->black.push_back({{x, y}, {x + width, y + height}});
}

/// Cells of side `cell`, (rows of `cols`), 1 for black: one rectangle for every run of black cells of a row.
void AddCells(const std::vector<uint8_t>& black, int cols, double x, double y, double cell, BoardPrint* print) {
  const int rows = static_cast<int>(black.size()) / cols;
  for (int row = 0; row < rows; ++row) {
    for (int begin = 0; begin < cols;) {
      int end = begin;
      while (end < cols && black[row * cols + end]) ++end;
      Add(x + begin * cell, y + row * cell, (end - begin) * cell, cell, print);
      begin = std::max(end, begin + 1);
    }
  }
}

/// The inside of a marker's cells; with `inverted` the frame around it is black too.
void AddMarker(const cv::Mat& bits, const Board& board, const Eigen::Vector2d& low, BoardPrint* print) {
  const double side = board.square_m, marker = board.marker_m, gap = (side - marker) / 2;
  std::vector<uint8_t> black;
  for (int i = 0; i < bits.rows * bits.cols; ++i)
    black.push_back((bits.at<uint8_t>(i / bits.cols, i % bits.cols) < 128) != board.inverted);
  AddCells(black, bits.cols, low.x() + gap, low.y() + gap, marker / bits.cols, print);
  if (!board.inverted) return;
  Add(low.x(), low.y(), side, gap, print);
  Add(low.x(), low.y() + gap, gap, marker, print);
  Add(low.x() + gap + marker, low.y() + gap, gap, marker, print);
  Add(low.x(), low.y() + gap + marker, side, gap, print);
}

BoardPrint SquaresPrint(const Board& board) {
  BoardPrint print;
  const double side = board.square_m, height = board.row_step();
  const bool charuco = board.kind == Board::Kind::kCharuco;
  print.low_m = {-side, -height};
  print.high_m = {board.cols * side, board.rows * height};
  print.quiet_m = 0.5 * std::max(side, height);
  for (int row = 0; row <= board.rows; ++row) {
    for (int col = 0; col <= board.cols; ++col) {
      const bool black = IsBlack(board, {col, row}) ? !board.inverted : board.inverted && !charuco;  // AddMarker blackens those
      if (black) Add((col - 1) * side, (row - 1) * height, side, height, &print);
    }
  }
  if (!charuco) return print;
  const auto dictionary = cv::aruco::getPredefinedDictionary(DictionaryIndex(board.dictionary));
  const std::vector<Square> squares = MarkerSquares(board);
  for (size_t n = 0; n < squares.size(); ++n) {
    cv::Mat bits;
    dictionary->drawMarker(board.first_tag + static_cast<int>(n), dictionary->markerSize + 2, bits, 1);
    AddMarker(bits, board, {(squares[n].col - 1) * side, (squares[n].row - 1) * side}, &print);
  }
  return print;
}

/// Kalibr's black squares at the crossings of the gaps, which make every corner of a tag a crossing of two edges.
void AddGapSquares(const Board& board, BoardPrint* print) {
  const double gap = board.tag_spacing * board.square_m, pitch = board.square_m + gap;
  for (int row = 0; row <= board.rows; ++row) {
    for (int col = 0; col <= board.cols; ++col) Add(col * pitch - gap, -row * pitch, gap, gap, print);
  }
}

BoardPrint TagsPrint(const Board& board) {
  const auto family = FindTagFamily(board.dictionary);
  MVS_CHECK(family, "family " << board.dictionary);
  BoardPrint print;
  const double side = board.square_m, pitch = side * (1 + board.tag_spacing), gap = side * board.tag_spacing;
  double outside = 0, cell = 0;
  for (int n = 0; n < board.cols * board.rows; ++n) {
    const TagPattern pattern = PatternOf(*family, board.first_tag + n, board.tag_border);
    cell = side / pattern.border_cells;
    outside = cell * (pattern.total_cells - pattern.border_cells) / 2;
    const double x = n % board.cols * pitch, y = -(n / board.cols) * pitch - side;
    AddCells(pattern.black, pattern.total_cells, x - outside, y - outside, cell, &print);
  }
  const bool gap_squares = board.kind == Board::Kind::kAprilGrid && !family->white_inside;
  if (gap_squares) AddGapSquares(board, &print);
  if (!family->white_inside) outside = 0;
  const double around = gap_squares ? gap : outside;
  print.low_m = {-around, -((board.rows - 1) * pitch + side + around)};
  print.high_m = {(board.cols - 1) * pitch + side + around, around};
  print.quiet_m = std::max(cell, gap_squares ? gap : 0);
  return print;
}

/// Adds 255 times the share of every pixel that the rectangle [x0, x1] x [y0, y1] (pixel edges are whole numbers) covers.
void Cover(double x0, double y0, double x1, double y1, int width, int height, std::vector<float>* grey) {
  const auto share = [](double low, double high, int i) {
    return std::max(0.0, std::min(high, i + 1.0) - std::max(low, double(i)));
  };
  const int v0 = std::max(0, static_cast<int>(std::floor(y0))), v1 = std::min(height - 1, static_cast<int>(std::ceil(y1)) - 1);
  const int u0 = std::max(0, static_cast<int>(std::floor(x0))), u1 = std::min(width - 1, static_cast<int>(std::ceil(x1)) - 1);
  for (int v = v0; v <= v1; ++v) {
    for (int u = u0; u <= u1; ++u) {
      (*grey)[static_cast<size_t>(v) * width + u] += static_cast<float>(255 * share(x0, x1, u) * share(y0, y1, v));
    }
  }
}

BoardPrint CirclesPrint(const Board& board) {
  BoardPrint print;
  const Eigen::Matrix3Xd centres = CornersInBoard(board);
  const double step = std::min(board.square_m, board.row_step());
  for (const auto& centre : centres.colwise()) print.discs.push_back({centre.head<2>(), board.circle_m / 2});
  const double around = board.circle_m / 2 + (board.inverted ? step / 2 : 0);
  print.low_m = centres.topRows<2>().rowwise().minCoeff().array() - around;
  print.high_m = centres.topRows<2>().rowwise().maxCoeff().array() + around;
  print.quiet_m = step / 2;
  print.white_discs = board.inverted;
  if (board.inverted) print.black.push_back({print.low_m, print.high_m});
  return print;
}

/// Adds `sign` times 255 times the share of every pixel that the disc covers, of its edge from 16 x 16 samples.
void CoverDisc(const Eigen::Vector2d& centre, double radius, double sign, int width, int height, std::vector<float>* grey) {
  constexpr int kSamples = 16;
  const auto low = [&](double at) { return std::max(0, static_cast<int>(std::floor(at - radius))); };
  for (int v = low(centre.y()); v < std::min<double>(height, centre.y() + radius); ++v) {
    for (int u = low(centre.x()); u < std::min<double>(width, centre.x() + radius); ++u) {
      const double distance = (Eigen::Vector2d(u + 0.5, v + 0.5) - centre).norm();
      if (distance > radius + 0.8) continue;
      int inside = distance < radius - 0.8 ? kSamples * kSamples : 0;
      for (int i = inside; i < kSamples * kSamples && distance >= radius - 0.8; ++i) {
        const Eigen::Vector2d at(u + (i % kSamples + 0.5) / kSamples, v + (i / kSamples + 0.5) / kSamples);
        inside += (at - centre).squaredNorm() <= radius * radius;
      }
      (*grey)[static_cast<size_t>(v) * width + u] += static_cast<float>(sign * 255 * inside / (kSamples * kSamples));
    }
  }
}

}  // namespace

BoardPrint PrintOf(const Board& board) {
  if (board.kind == Board::Kind::kGrid || board.kind == Board::Kind::kPoints) {
    throw UsageError("board " + ToString(board) + " has no print: it stands for corners that another program found");
  }
  if (IsSet(board)) throw UsageError("board " + ToString(board) + " is a set of tags: draw each by itself, with one id");
  if (board.is_round()) return CirclesPrint(board);
  return board.has_tags() ? TagsPrint(board) : SquaresPrint(board);
}

Image DrawBoard(const Board& board, int px_per_square, double margin_squares) {
  MVS_CHECK(px_per_square >= 2, "px_per_square = " << px_per_square);
  MVS_CHECK(margin_squares >= 0, "margin_squares = " << margin_squares);
  const BoardPrint print = PrintOf(board);
  const double scale = px_per_square / board.square_m, margin = margin_squares * px_per_square;
  const Eigen::Vector2d size = (print.high_m - print.low_m) * scale + Eigen::Vector2d::Constant(2 * margin);
  Image image(static_cast<int>(std::lround(size.x())), static_cast<int>(std::lround(size.y())), 1);
  std::vector<float> ink(image.pixels.size(), 0);
  const auto snap = [](double value) { return std::abs(value - std::round(value)) < 1e-9 ? std::round(value) : value; };
  for (const PrintRect& r : print.black) {
    const Eigen::Vector2d low = (r.low - print.low_m) * scale + Eigen::Vector2d::Constant(margin);
    const Eigen::Vector2d high = (r.high - print.low_m) * scale + Eigen::Vector2d::Constant(margin);
    Cover(snap(low.x()), snap(low.y()), snap(high.x()), snap(high.y()), image.width, image.height, &ink);
  }
  for (const PrintDisc& disc : print.discs) {
    const Eigen::Vector2d at = (disc.centre - print.low_m) * scale + Eigen::Vector2d::Constant(margin);
    CoverDisc(at, disc.radius * scale, print.white_discs ? -1 : 1, image.width, image.height, &ink);
  }
  for (size_t i = 0; i < ink.size(); ++i)
    image.pixels[i] = static_cast<uint8_t>(std::lround(255 - std::clamp(ink[i], 0.f, 255.f)));
  return image;
}

}  // namespace mvstudio::calib
