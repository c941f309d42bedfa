#pragma once

#include <Eigen/Core>
#include <string>

#include "core/image.h"

namespace mvstudio::calib {

/// A planar calibration target. Corners are numbered row by row; corner (row, col) lies at (col, row, 0) * square_m in the
/// frame `board`: x along the columns, y along the rows, z = x cross y (into the board, away from the viewer of its printed
/// side).
struct Board {
  enum class Kind { kChessboard, kCharuco };
  Kind kind = Kind::kChessboard;
  int cols = 0;                         ///< inner corners per row
  int rows = 0;                         ///< inner corners per column
  double square_m = 0;                  ///< side of a square, metres
  double marker_m = 0;                  ///< charuco: side of a marker, metres
  std::string dictionary = "4x4_1000";  ///< charuco: OpenCV's predefined dictionary, lower case without DICT_
  bool legacy = false;  ///< charuco: the layout of OpenCV before 4.6 (differs when the number of squares per column is even)

  int num_corners() const { return cols * rows; }
};

/// Reads `chessboard:9x6:25mm` (inner corners) or `charuco:8x6:60mm:45mm[:DICT][:legacy]` (SQUARES per row x column, square,
/// marker). Units mm, cm or m are required. Throws UsageError that says what was expected.
Board ParseBoard(const std::string& text);
std::string ToString(const Board& board);

/// Corner positions in the frame board, metres, (3, cols * rows).
Eigen::Matrix3Xd CornersInBoard(const Board& board);

/// The printed side at `px_per_square` pixels a square, grey, with a quiet margin of `margin_squares` squares of white all
/// around. Board coordinates (x, y) of image pixel (u, v): x = ((u + 0.5) / px_per_square - margin_squares - 1) * square_m,
/// same for y (the outer squares lie outside the inner corners).
Image DrawBoard(const Board& board, int px_per_square, double margin_squares);

}  // namespace mvstudio::calib
