#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calib/board/board.h"
#include "calib/board/detection.h"

namespace mvstudio::calib {

/// A board whose corners stand as if it had another number of columns than it is described with.
struct LayoutFault {
  int board = 0;
  int told_cols = 0, told_rows = 0, cols = 0, rows = 0;
  double told_px = 0, found_px = 0;  ///< median distance of corners from the nearest image of a plane
};

/// One line.
std::string ToString(const LayoutFault& fault);

/// Boards whose corners are numbered row by row. Each view's corners are compared with the image of a plane (a homography) for every
/// number of columns; another number is believed when it brings the corners at least five times nearer, to within 2 % of the board's
/// size in the image.
std::optional<LayoutFault> FindLayoutFault(const std::vector<Board>& boards, const std::vector<Detection>& detections);

}  // namespace mvstudio::calib
