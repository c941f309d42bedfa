#pragma once

#include "calib/board/board.h"

namespace mvstudio::calib {

/// Metres; of circles whose board does not state their diameter.
double UsualDiameter(const Board& board);

}  // namespace mvstudio::calib
