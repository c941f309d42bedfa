#pragma once

#include <map>
#include <string>
#include <vector>

#include "calib/board/board.h"
#include "calib/detect/corner_refine.h"
#include "core/image.h"

namespace mvstudio::calib {

enum class ChessboardSearch {
  kFast,     ///< OpenCV's classic search with its quick look first
  kExact,    ///< the classic search without the quick look, then the sector-based one
  kSectors,  ///< OpenCV's sector-based search alone; sometimes wrong by many pixels with success
};

/// First guesses of all corners of a chessboard, numbered as on the board; empty when it is not seen as a whole.
std::vector<CornerGuess> SearchChessboard(const Board& board, const Image& grey, ChessboardSearch how);

/// Markers or tags found in an image.
struct FoundMarkers {
  /// id -> corners, px: clockwise from the top left for ChArUco, as in Tag::px for tags.
  std::map<int, Eigen::Matrix<double, 2, 4>> px;
  int num_repeated = 0;  ///< tags left out because they are seen more than once
};

/// Everything of the board's dictionary or family. Boards with the same MarkerKey share the result. ArUco markers are searched
/// at twice the resolution too when few are found and `enlarge` is set.
FoundMarkers FindMarkers(const Board& board, const Image& grey, bool enlarge = true);
std::string MarkerKey(const Board& board);

struct MarkerSearch {
  std::vector<CornerGuess> guesses;
  int num_markers = 0;   ///< found, with an id of the board
  int num_agreeing = 0;  ///< of those, where the others put them
};

/// First guesses of the corners of tags, and of the ChArUco corners next to markers by a homography of the marker corners around
/// each (OpenCV 4.6's own interpolation is not used).
MarkerSearch PlaceCorners(const Board& board, const FoundMarkers& found);

}  // namespace mvstudio::calib
