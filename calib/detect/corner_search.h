#pragma once

#include <map>
#include <string>
#include <vector>

#include "calib/board/board.h"
#include "calib/detect/corner_refine.h"
#include "core/image.h"

namespace mvstudio::calib {

enum class ChessboardSearch {
  kFast,     ///< OpenCV's classic search after its fast pre-check
  kExact,    ///< the classic search without the pre-check, then the sector-based one
  kSectors,  ///< OpenCV's sector-based search alone; sometimes reports success with errors of many pixels
};

struct ChessboardFind {
  /// Initial positions of all corners, numbered as on the board; of a board that looks alike in several turns in the one whose
  /// x axis points most to the right. Empty: the board is not visible as a whole.
  std::vector<CornerGuess> guesses;
  bool exchanged = false;  ///< in no turn the squares have the board's colours: black and white are exchanged
};
ChessboardFind SearchChessboard(const Board& board, const Image& grey, ChessboardSearch how);

/// Markers or tags found in an image.
struct FoundMarkers {
  /// id -> corners, px: clockwise from the top left for ChArUco, as in Tag::px for tags.
  std::map<int, Eigen::Matrix<double, 2, 4>> px;
  int num_repeated = 0;  ///< tags left out because they are seen more than once
};

/// All markers of the board's dictionary or family. Boards with the same MarkerKey share the result. If few ArUco markers
/// are found and `enlarge` is set, the search is repeated at twice the resolution.
FoundMarkers FindMarkers(const Board& board, const Image& grey, bool enlarge = true);
std::string MarkerKey(const Board& board);

struct MarkerSearch {
  std::vector<CornerGuess> guesses;
  int num_markers = 0;   ///< found, with an id of the board
  int num_agreeing = 0;  ///< of those, at the position that the others predict
};

/// Initial positions of the corners of tags, and of the ChArUco corners next to markers. Each comes from a homography of
/// the marker corners around it (OpenCV 4.6's own interpolation is not used).
MarkerSearch PlaceCorners(const Board& board, const FoundMarkers& found);

}  // namespace mvstudio::calib
