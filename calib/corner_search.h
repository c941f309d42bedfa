#pragma once

#include <vector>

#include "calib/board.h"
#include "calib/corner_refine.h"
#include "core/image.h"

namespace mvstudio::calib {

/// First guesses of all corners of a chessboard, numbered as on the board; empty when it is not seen as a whole. `exact` also
/// tries OpenCV's sector-based search.
std::vector<CornerGuess> SearchChessboard(const Board& board, const Image& grey, bool exact);

struct CharucoSearch {
  std::vector<CornerGuess> guesses;
  int num_markers = 0;   ///< found, with an id of the board
  int num_agreeing = 0;  ///< of those, where the others put them
};

/// First guesses of the ChArUco corners next to detected markers, by a homography of the marker corners around each
/// (OpenCV 4.6's own interpolation is not used).
CharucoSearch SearchCharuco(const Board& board, const Image& grey);

}  // namespace mvstudio::calib
