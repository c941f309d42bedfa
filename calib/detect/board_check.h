#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "calib/board/board.h"
#include "core/image.h"
#include "core/progress.h"

namespace mvstudio::calib {

/// A board that might be the one in the images, and how well it fits them.
struct BoardTrial {
  Board board;
  bool mirrored = false;  ///< searched in the mirrored images
  std::string relation;   ///< how it differs from the board that was asked for; "as given" for that itself
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
  /// Located by RefineCorner (2, 4); NaN where the image does not look like a corner. A fit of two edges of a lone tag.
  Eigen::Matrix<double, 2, 4> refined_px;
};

struct BoardCheckReport {
  int num_images = 0;
  std::vector<BoardTrial> trials;  ///< everything that was tried, best first
  std::optional<size_t> best;      ///< into trials; nothing when no trial fits any image
  bool scale_known = false;        ///< false without a given board: lengths are in units of a square (a tag's side)
  std::vector<SeenTag> tags;       ///< of every AprilTag family that was found
};

/// Which board is in the images (grey or RGB)? Besides `given`, if any: rows and columns exchanged, numbers of squares for inner
/// corners and the reverse, legacy layout, black and white exchanged, mirrored images, every dictionary and AprilTag family, the
/// layouts that the positions of the markers tell, and the sizes of chessboards that are seen.
BoardCheckReport CheckBoard(const std::optional<Board>& given, const std::vector<Image>& images, const RunContext& run);

/// ToString, with SQUARE or SIDE in place of lengths when the scale is not known.
std::string BoardText(const Board& board, bool scale_known);

}  // namespace mvstudio::calib
