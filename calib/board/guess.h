#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "calib/board/board.h"
#include "core/image.h"

namespace mvstudio::calib {

/// Markers of one image: id -> corners, clockwise (ArUco: from the top left) or counter-clockwise (tags: from the bottom left).
using MarkersOfImage = std::map<int, Eigen::Matrix<double, 2, 4>>;

/// The ChArUco board (square_m = 1) whose layout puts the ids where the markers are, in most of the images; nothing when none
/// fits. Rows are as many as the ids need at least; `hint` decides where the ids leave the choice.
std::optional<Board> GuessCharuco(const std::string& dictionary, const std::vector<MarkersOfImage>& images,
                                  const std::optional<Board>& hint);

/// Same for an AprilGrid (square_m = 1), with the gap measured to a few hundredths of a tag's side.
std::optional<Board> GuessAprilGrid(const std::string& family, const std::vector<MarkersOfImage>& images,
                                    const std::optional<Board>& hint);

/// Sizes (columns, rows of inner corners) of chessboards seen in the image, whatever their size.
std::optional<std::pair<int, int>> GuessChessboard(const Image& grey);

}  // namespace mvstudio::calib
