#pragma once

#include <string>
#include <vector>

#include "calib/bundle/view.h"

namespace mvstudio::calib {

/// Cameras that number a board's corners differently from the others.
struct NumberingFault {
  std::vector<std::string> cameras;  ///< the smaller of the two sides; both when they are equal
  std::string what;                  ///< "turned by half a turn", "by a column more", …
  double spread = 0, mended_spread = 0;  ///< spread of the relative pose, in board sizes: as numbered, and after renumbering
};

/// One line.
std::string ToString(const NumberingFault& fault);

/// Finds cameras that number a board's corners differently. A moving board gives two cameras the same relative pose in
/// every frame only if both number its corners alike. Half a turn and one column or row more or less are tried for each
/// pair of cameras that shares five or more boards. A renumbering is accepted if it makes the spread of the relative pose
/// four times smaller, and less than a tenth of the board. `cam_from_board[v]` belongs to views[v] and comes from that
/// view alone.
std::vector<NumberingFault> FindNumberingFaults(const std::vector<View>& views, const std::vector<geometry::Rigid3>& cam_from_board,
                                                const std::vector<std::string>& camera_names);

}  // namespace mvstudio::calib
