#include "calib/board/board.h"

#include <algorithm>
#include <string>

#include "calib/board/charuco_layout.h"
#include "calib/board/sets.h"

namespace mvstudio::calib {
namespace {

/// A smaller dictionary of ArUco markers is the beginning of a larger one (4x4_50, 4x4_1000); others are AprilTag's families.
std::string FamilyOf(const Board& board) {
  const std::string& name = board.dictionary;
  if (name.rfind("apriltag_", 0) == 0) return name.substr(name.find('_') + 1);
  return name.find('x') != std::string::npos ? name.substr(0, name.find('_')) : name;
}

int NumMarks(const Board& board) {
  return board.has_tags() ? board.cols * board.rows : static_cast<int>(MarkerSquares(board).size());
}

}  // namespace

int Board::num_side_corners() const {
  switch (kind) {
    case Kind::kAprilGrid:
      return 4 * cols * rows;
    case Kind::kTag:
      return 4;
    case Kind::kPoints:
      return static_cast<int>(points.cols());
    default:
      return cols * rows;
  }
}

int NumLikeTurns(const Board& board) {
  const bool square = board.cols == board.rows && board.row_step() == board.square_m;
  const bool even = (board.cols + board.rows) % 2 == 0;
  switch (board.kind) {
    case Board::Kind::kChessboard:
      if (!even) return 1;
      return square && board.cols % 2 == 0 ? 4 : 2;
    case Board::Kind::kGrid:
    case Board::Kind::kCircles:
      return square ? 4 : 2;
    case Board::Kind::kAsymmetricCircles:
      return board.rows % 2 == 0 ? 2 : 1;
    default:
      return 1;
  }
}

Eigen::Matrix3Xd CornersInBoard(const Board& board) {
  if (board.kind == Board::Kind::kPoints) return board.points;
  const int side = board.num_side_corners();
  Eigen::Matrix3Xd corners(3, board.num_corners());
  for (int i = 0; i < side; ++i) {
    if (board.has_tags()) {
      const int tag = i / 4, k = i % 4;
      const double pitch = 1 + board.tag_spacing;
      const double x = tag % board.cols * pitch + (k == 1 || k == 2), y = tag / board.cols * pitch + (k >= 2);
      corners.col(i) = Eigen::Vector3d(x, -y, 0) * board.square_m;
    } else if (board.kind == Board::Kind::kAsymmetricCircles) {
      const int row = i / board.cols, col = i % board.cols;
      corners.col(i) = Eigen::Vector3d(2 * col + row % 2, row, 0) * board.square_m;
    } else {
      corners.col(i) << i % board.cols * board.square_m, i / board.cols * board.row_step(), 0;
    }
  }
  if (!board.back_m) return corners;
  corners.rightCols(side) = corners.leftCols(side);
  corners.rightCols(side).row(2).setConstant(*board.back_m);
  return corners;
}

Board FrontOf(Board board) {
  board.back_m.reset();
  return board;
}

std::vector<Board> SingleBoards(const std::vector<Board>& boards) {
  std::vector<Board> singles;
  for (const Board& board : boards) {
    Board single = board;
    if (IsSet(board)) single.cols = 1;
    for (int n = 0; n < (IsSet(board) ? board.cols : 1); ++n, ++single.first_tag) singles.push_back(single);
  }
  return singles;
}

std::string SharedMarks(const Board& a, const Board& b) {
  const auto marked = [](const Board& board) { return board.has_tags() || board.kind == Board::Kind::kCharuco; };
  const bool tags = a.has_tags() && b.has_tags();
  if (!marked(a) || !marked(b)) return a.kind == b.kind && ToString(a) == ToString(b) ? "everything" : "";
  if (FamilyOf(a) != FamilyOf(b)) return "";
  const int first = std::max(a.first_tag, b.first_tag);
  const int last = std::min(a.first_tag + NumMarks(a), b.first_tag + NumMarks(b)) - 1;
  if (first > last) return "";
  return (tags ? "tags " : "markers ") + std::to_string(first) + " to " + std::to_string(last) + " of " + FamilyOf(a);
}

}  // namespace mvstudio::calib
