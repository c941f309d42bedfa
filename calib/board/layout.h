#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calib/board/board.h"
#include "calib/board/detection.h"

namespace mvstudio::calib {

/// A board whose detected corners fit a different number of columns than its description states.
struct LayoutFault {
  int board = 0;
  int told_cols = 0, told_rows = 0, cols = 0, rows = 0;
  double told_px = 0, found_px = 0;  ///< median distance of the corners from a homography's image of the board: as described
                                     ///< (told) and as found
  std::string mended;                ///< text of the board that was found
};

/// One line.
std::string ToString(const LayoutFault& fault);

/// Checks the described number of columns of boards whose corners are numbered row by row. For each possible number, a
/// homography is fitted to every view. Another number is accepted if it makes the distances at least five times smaller,
/// and at most 2 % of the board's size in the image.
std::optional<LayoutFault> FindLayoutFault(const std::vector<Board>& boards, const std::vector<Detection>& detections);

}  // namespace mvstudio::calib
