#pragma once

#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "calib/board/board.h"
#include "core/image.h"

namespace mvstudio::calib {

/// Markers of one image: id -> corners. ArUco: clockwise from the top left; tags: counter-clockwise from the bottom left.
using MarkersOfImage = std::map<int, Eigen::Matrix<double, 2, 4>>;

/// The ChArUco board (square_m = 1) whose layout agrees with the marker positions in most of the images; empty when none
/// fits. The number of rows is the smallest that holds the ids where the layout puts them; ids so high that less than a
/// quarter of such a board's markers was ever seen are clutter and left out. `hint` decides where the ids allow several boards.
std::optional<Board> GuessCharuco(const std::string& dictionary, const std::vector<MarkersOfImage>& images,
                                  const std::optional<Board>& hint);

/// Same for an AprilGrid (square_m = 1); its gap is measured to a few hundredths of a tag's side.
std::optional<Board> GuessAprilGrid(const std::string& family, const std::vector<MarkersOfImage>& images,
                                    const std::optional<Board>& hint);

/// Size (columns, rows of inner corners) of a chessboard of unknown size in the image.
std::optional<std::pair<int, int>> GuessChessboard(const Image& grey);

}  // namespace mvstudio::calib
