#pragma once

#include <Eigen/Core>
#include <vector>

#include "calib/board/board.h"

namespace mvstudio::calib {

/// A rectangle in the frame board, metres.
struct PrintRect {
  Eigen::Vector2d low = Eigen::Vector2d::Zero(), high = Eigen::Vector2d::Zero();
};

/// A disc in the frame board, metres.
struct PrintDisc {
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  double radius = 0;
};

/// The printed pattern of a board: black rectangles that do not overlap, on white paper, and discs.
struct BoardPrint {
  std::vector<PrintRect> black;
  std::vector<PrintDisc> discs;  ///< do not overlap; black on white paper, or white on black rectangles
  bool white_discs = false;
  Eigen::Vector2d low_m = Eigen::Vector2d::Zero(), high_m = Eigen::Vector2d::Zero();  ///< corners of the print without margin
  double quiet_m = 0;  ///< white margin around the print that detection needs
};

/// Throws UsageError for boards that have no print (kGrid, kPoints).
BoardPrint PrintOf(const Board& board);

}  // namespace mvstudio::calib
