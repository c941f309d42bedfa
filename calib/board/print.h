#pragma once

#include <Eigen/Core>
#include <vector>

#include "calib/board/board.h"

namespace mvstudio::calib {

/// A rectangle in the frame board, metres.
struct PrintRect {
  Eigen::Vector2d low = Eigen::Vector2d::Zero(), high = Eigen::Vector2d::Zero();
};

/// The printed pattern of a board: black rectangles that do not overlap, on white paper.
struct BoardPrint {
  std::vector<PrintRect> black;
  Eigen::Vector2d low_m = Eigen::Vector2d::Zero(), high_m = Eigen::Vector2d::Zero();  ///< corners of the print without margin
  double quiet_m = 0;  ///< white margin around the print that detection needs
};

/// Throws UsageError for boards that have no print (kGrid, kPoints).
BoardPrint PrintOf(const Board& board);

}  // namespace mvstudio::calib
