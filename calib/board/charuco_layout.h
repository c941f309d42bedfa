#pragma once

#include <string>
#include <vector>

#include "calib/board/board.h"

namespace mvstudio::calib {

/// A square of the board's grid: column and row from the top left of the printed side.
struct Square {
  int col = 0, row = 0;
};

/// Colour of a square before Board::inverted exchanges them all. The top-left one is black, except in the legacy ChArUco layout
/// with an even number of rows of squares.
bool IsBlack(const Board& board, Square square);

/// The squares that carry markers (the white ones), row by row; the marker's id is Board::first_tag plus the position in this
/// list. Empty for a chessboard.
std::vector<Square> MarkerSquares(const Board& board);

/// "4x4_50, …", and the one of them that `name` means in any case and with or without `DICT_`; `name` itself for none.
std::string DictionaryNames();
std::string CanonicalDictionary(const std::string& name);
/// Index of OpenCV's predefined dictionary called `name` (`4x4_50` … `apriltag_36h11`), or -1.
int DictionaryIndex(const std::string& name);

/// Whether the legacy layout of this ChArUco board differs from that of OpenCV 4.6.
bool HasTwoLayouts(const Board& board);

}  // namespace mvstudio::calib
