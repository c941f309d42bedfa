#pragma once

#include <vector>

#include "calib/board/observations.h"

/// Boards with two sides whose thickness nobody stated (`two-sided` without a length): Board::back_m is NaN.
namespace mvstudio::calib {

bool ThicknessUnknown(const Board& board);

/// Throws UsageError for such a board: what to write instead.
void RequireThickness(const std::vector<Board>& boards);

/// Makes the back of every such board a board of its own, numbered and laid out as its front, whose place a calibration
/// tells: z of its pose in the front is the thickness. Returns per board the one whose back it is; -1: a front.
std::vector<int> PartSides(CalibrateInput* input);

}  // namespace mvstudio::calib
