#pragma once

#include <optional>
#include <vector>

#include "calib/board/draw.h"

namespace mvstudio::calib {

struct ProposeOptions {
  Paper paper = Paper::kA4;
  double fov_deg = 65;        ///< horizontal field of view of the cameras
  int image_width_px = 1920;  ///< of their images
};

template <class Visitor>
void VisitFields(Visitor&& visit, ProposeOptions& o) {
  visit("paper", o.paper, "a4, a3, a2, a1 or letter, rotated when the board fits better");
  visit("fov", o.fov_deg, "horizontal field of view of the cameras, degrees");
  visit("image-width", o.image_width_px, "width of their images, px");
}

struct BoardProposal {
  Board board;
  double width_m = 0, height_m = 0;  ///< of the print without margin
  double near_m = 0;                 ///< nearer, the board is wider than the image
  double far_m = 0;                  ///< farther, its markers or squares have too few pixels to be found reliably
  /// False: no distance suits, for the board fills the image before its markers or squares have enough pixels.
  bool Suits() const { return near_m <= far_m; }
};

/// Width of images of the same field of view, px, from which on some distance suits the board.
int LeastImageWidthPx(const BoardProposal& proposal, int image_width_px);

/// The side of a square or tag in px below which boards are no longer found reliably when they are tilted by 40 degrees,
/// blurred by 0.7 px and noisy (2 grey values of 255). Measured by rendering; tests hold it.
double LeastSquarePx(Board::Kind kind);

/// Boards that fill the paper, those with large squares first. Throws UsageError for options that are out of range and for
/// paper without a size.
std::vector<BoardProposal> ProposeBoards(const ProposeOptions& options);

/// The board with lengths scaled down until it fits on the paper, its side in whole mm (tenths below 5 mm); empty when not even
/// a side of 1 mm fits.
std::optional<Board> LargestOn(const Board& board, Paper paper);

}  // namespace mvstudio::calib
