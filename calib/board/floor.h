#pragma once

#include "geometry/rigid/rigid3.h"

namespace mvstudio::calib {

/// World of a board that lies face up: origin at the board's, x along its columns, z up, so y against its rows.
inline geometry::Rigid3 WorldFromFloorBoard() {
  geometry::Rigid3 world_from_board;
  world_from_board.rotation = Eigen::Quaterniond(0, 1, 0, 0);
  return world_from_board;
}

}  // namespace mvstudio::calib
