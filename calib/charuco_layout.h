#pragma once

#include <vector>

#include "calib/board.h"

namespace mvstudio::calib {

/// A square of the board's grid: column and row from the top left of the printed side.
struct Square {
  int col = 0, row = 0;
};

/// Colour of a square. The top-left one is black, except in the legacy ChArUco layout with an even number of rows of squares.
bool IsBlack(const Board& board, Square square);

/// The white squares that carry markers; the marker's id is the position in this list. Empty for a chessboard.
std::vector<Square> MarkerSquares(const Board& board);

/// Index of OpenCV's predefined dictionary called `name` (`4x4_50` … `apriltag_36h11`), or -1.
int DictionaryIndex(const std::string& name);

}  // namespace mvstudio::calib
