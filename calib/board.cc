#include "calib/board.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <opencv2/aruco.hpp>
#include <sstream>
#include <vector>

#include "calib/charuco_layout.h"
#include "core/check.h"
#include "core/error.h"

namespace mvstudio::calib {
namespace {

constexpr const char* kDictionaries[] = {
    "4x4_50",   "4x4_100",  "4x4_250",        "4x4_1000",      "5x5_50",        "5x5_100",        "5x5_250",
    "5x5_1000", "6x6_50",   "6x6_100",        "6x6_250",       "6x6_1000",      "7x7_50",         "7x7_100",
    "7x7_250",  "7x7_1000", "aruco_original", "apriltag_16h5", "apriltag_25h9", "apriltag_36h10", "apriltag_36h11"};

constexpr char kExpected[] =
    "expected chessboard:COLSxROWS:SQUARE (inner corners) or charuco:COLSxROWS:SQUARE:MARKER[:DICTIONARY][:legacy] (squares), "
    "e.g. chessboard:9x6:25mm or charuco:8x6:60mm:45mm:4x4_1000";

[[noreturn]] void Fail(const std::string& text, const std::string& what) {
  throw UsageError("board '" + text + "': " + what + "; " + kExpected);
}

std::vector<std::string> Split(const std::string& text) {
  std::vector<std::string> parts;
  std::istringstream in(text);
  for (std::string part; std::getline(in, part, ':');) parts.push_back(part);
  return parts;
}

double ParseLength(const std::string& text, const std::string& board) {
  size_t used = 0;
  double value = 0;
  try {
    value = std::stod(text, &used);
  } catch (const std::exception&) {
    Fail(board, "'" + text + "' is not a length");
  }
  const std::string unit = text.substr(used);
  if (unit != "mm" && unit != "cm" && unit != "m") Fail(board, "the length '" + text + "' needs a unit mm, cm or m");
  value *= unit == "mm" ? 1e-3 : unit == "cm" ? 1e-2 : 1;
  if (!(value > 0) || !std::isfinite(value)) Fail(board, "the length '" + text + "' must be positive");
  return value;
}

void ParseGrid(const std::string& text, const std::string& board, int* cols, int* rows) {
  char end = 0;
  if (std::sscanf(text.c_str(), "%dx%d%c", cols, rows, &end) != 2) Fail(board, "'" + text + "' is not COLSxROWS");
  if (*cols < 2 || *rows < 2 || *cols > 200 || *rows > 200) Fail(board, "the grid " + text + " must be from 2x2 to 200x200");
}

Board ParseCharuco(const std::vector<std::string>& parts, const std::string& text) {
  Board board;
  board.kind = Board::Kind::kCharuco;
  if (parts.size() < 4 || parts.size() > 6) Fail(text, "a ChArUco board has 4 to 6 parts");
  ParseGrid(parts[1], text, &board.cols, &board.rows);
  if (board.cols < 3 || board.rows < 3) Fail(text, "a ChArUco board needs at least 3x3 squares");
  board.cols -= 1, board.rows -= 1;
  board.square_m = ParseLength(parts[2], text);
  board.marker_m = ParseLength(parts[3], text);
  if (board.marker_m >= board.square_m) Fail(text, "the marker must be smaller than the square");
  for (size_t i = 4; i < parts.size(); ++i) {
    if (parts[i] == "legacy") {
      board.legacy = true;
    } else {
      board.dictionary = parts[i];
    }
  }
  const int index = DictionaryIndex(board.dictionary);
  if (index < 0) Fail(text, "unknown dictionary '" + board.dictionary + "'");
  const int available = cv::aruco::getPredefinedDictionary(index)->bytesList.rows;
  if (static_cast<int>(MarkerSquares(board).size()) > available) {
    Fail(text, "dictionary " + board.dictionary + " has only " + std::to_string(available) + " markers");
  }
  return board;
}

std::string Millimetres(double length_m) {
  char text[32];
  std::snprintf(text, sizeof text, "%.10gmm", length_m * 1e3);
  return text;
}

/// Brightness of the printed side in board units: (x, y) in squares from the top-left outer corner. 0 black, 1 white.
class Pattern {
 public:
  explicit Pattern(const Board& board) : board_(board), marker_(board.marker_m / board.square_m) {
    if (board.kind != Board::Kind::kCharuco) return;
    const auto dictionary = cv::aruco::getPredefinedDictionary(DictionaryIndex(board.dictionary));
    cells_ = dictionary->markerSize + 2;
    marker_of_square_.assign((board.cols + 1) * (board.rows + 1), -1);
    const std::vector<Square> squares = MarkerSquares(board);
    for (size_t id = 0; id < squares.size(); ++id) {
      marker_of_square_[squares[id].row * (board.cols + 1) + squares[id].col] = static_cast<int>(id);
      cv::Mat bits;
      dictionary->drawMarker(static_cast<int>(id), cells_, bits, 1);
      bits_.push_back(bits);
    }
  }

  double operator()(double x, double y) const {
    const Square square{static_cast<int>(std::floor(x)), static_cast<int>(std::floor(y))};
    if (square.col < 0 || square.row < 0 || square.col > board_.cols || square.row > board_.rows) return 1;
    if (IsBlack(board_, square)) return 0;
    if (bits_.empty()) return 1;
    const int id = marker_of_square_[square.row * (board_.cols + 1) + square.col];
    const double scale = cells_ / marker_, margin = (1 - marker_) / 2;
    const int col = static_cast<int>(std::floor((x - square.col - margin) * scale));
    const int row = static_cast<int>(std::floor((y - square.row - margin) * scale));
    if (col < 0 || row < 0 || col >= cells_ || row >= cells_) return 1;
    return bits_[id].at<uint8_t>(row, col) > 127 ? 1 : 0;
  }

 private:
  const Board& board_;
  double marker_;
  int cells_ = 0;
  std::vector<int> marker_of_square_;
  std::vector<cv::Mat> bits_;
};

}  // namespace

bool IsBlack(const Board& board, Square square) {
  const bool inverted = board.kind == Board::Kind::kCharuco && board.legacy && (board.rows + 1) % 2 == 0;
  return ((square.col + square.row) % 2 == 0) != inverted;
}

std::vector<Square> MarkerSquares(const Board& board) {
  std::vector<Square> squares;
  if (board.kind != Board::Kind::kCharuco) return squares;
  for (int row = 0; row <= board.rows; ++row) {
    for (int col = 0; col <= board.cols; ++col) {
      if (!IsBlack(board, {col, row})) squares.push_back({col, row});
    }
  }
  return squares;
}

int DictionaryIndex(const std::string& name) {
  const auto found = std::find(std::begin(kDictionaries), std::end(kDictionaries), name);
  return found == std::end(kDictionaries) ? -1 : static_cast<int>(found - std::begin(kDictionaries));
}

Board ParseBoard(const std::string& text) {
  const std::vector<std::string> parts = Split(text);
  if (!parts.empty() && parts[0] == "charuco") return ParseCharuco(parts, text);
  if (parts.empty() || parts[0] != "chessboard") Fail(text, "unknown kind of board");
  if (parts.size() != 3) Fail(text, "a chessboard has 3 parts");
  Board board;
  ParseGrid(parts[1], text, &board.cols, &board.rows);
  board.square_m = ParseLength(parts[2], text);
  return board;
}

std::string ToString(const Board& board) {
  const bool charuco = board.kind == Board::Kind::kCharuco;
  const int extra = charuco ? 1 : 0;
  std::string text = std::string(charuco ? "charuco:" : "chessboard:") + std::to_string(board.cols + extra) + "x" +
                     std::to_string(board.rows + extra) + ":" + Millimetres(board.square_m);
  if (charuco) text += ":" + Millimetres(board.marker_m) + ":" + board.dictionary + (board.legacy ? ":legacy" : "");
  return text;
}

Eigen::Matrix3Xd CornersInBoard(const Board& board) {
  Eigen::Matrix3Xd corners(3, board.num_corners());
  for (int i = 0; i < board.num_corners(); ++i) {
    corners.col(i) = Eigen::Vector3d(i % board.cols, i / board.cols, 0) * board.square_m;
  }
  return corners;
}

Image DrawBoard(const Board& board, int px_per_square, double margin_squares) {
  MVS_CHECK(px_per_square >= 2, "px_per_square = " << px_per_square);
  MVS_CHECK(margin_squares >= 0, "margin_squares = " << margin_squares);
  constexpr int kSub = 4;  // samples per pixel side
  const auto size = [&](int squares) { return static_cast<int>(std::lround((squares + 2 * margin_squares) * px_per_square)); };
  const Pattern pattern(board);
  Image image(size(board.cols + 1), size(board.rows + 1), 1);
  for (int v = 0; v < image.height; ++v) {
    for (int u = 0; u < image.width; ++u) {
      double sum = 0;
      for (int s = 0; s < kSub * kSub; ++s) {
        const double x = (u + (s % kSub + 0.5) / kSub) / px_per_square - margin_squares;
        const double y = (v + (s / kSub + 0.5) / kSub) / px_per_square - margin_squares;
        sum += pattern(x, y);
      }
      *image.Pixel(u, v) = static_cast<uint8_t>(std::lround(255 * sum / (kSub * kSub)));
    }
  }
  return image;
}

}  // namespace mvstudio::calib
