#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "calib/board/board.h"
#include "core/image.h"
#include "core/progress.h"

namespace mvstudio::calib {

/// A candidate for the board in the images, and how well it fits.
struct BoardTrial {
  Board board;
  bool mirrored = false;  ///< searched in the mirrored images
  std::string relation;   ///< difference from the given board; "as given" for that itself
  int num_images = 0;     ///< in which it was found
  int num_corners = 0;
  double residual_px = 0;  ///< median over the images of the distance from the smooth image of a plane, per coordinate
};

/// A tag as found in one image.
struct SeenTag {
  int image = 0;
  std::string family;
  int id = 0, border = 1;
  Eigen::Matrix<double, 2, 4> px;  ///< corners of the library, see Tag::px
  /// Located by RefineCorner (2, 4), by fitting the two edges of a lone tag; NaN where the grey values do not fit a
  /// corner.
  Eigen::Matrix<double, 2, 4> refined_px;
};

/// ArUco markers that were found without the board that they belong to.
struct SeenMarkers {
  std::string dictionary;
  int num_images = 0;  ///< in which some were found
  int smallest_id = 0, largest_id = 0, num_ids = 0;
};

struct BoardCheckReport {
  int num_images = 0;
  std::vector<BoardTrial> trials;    ///< all candidates, best first
  std::optional<size_t> best;        ///< into trials; empty when no candidate fits any image
  bool scale_known = false;          ///< false without a given board: lengths are then in units of a square (a tag's side)
  std::vector<SeenTag> tags;         ///< of all AprilTag families
  std::vector<SeenMarkers> markers;  ///< of dictionaries for which no layout was found
};

/// Identifies the board in the images (grey or RGB). Tried besides `given`, if any: rows and columns exchanged, squares
/// counted instead of inner corners and the reverse, legacy layout, black and white exchanged, and mirrored images. Also
/// every dictionary and AprilTag family, layouts derived from marker positions, sizes of visible chessboards, and grids of
/// circles.
BoardCheckReport CheckBoard(const std::optional<Board>& given, const std::vector<Image>& images, const RunContext& run);

/// ToString, with SQUARE or SIDE in place of lengths when the scale is not known.
std::string BoardText(const Board& board, bool scale_known);

}  // namespace mvstudio::calib
