#pragma once

#include <string>
#include <vector>

#include "calib/bundle/view.h"

namespace mvstudio::calib {

/// Cameras that number a board's corners otherwise than the rest.
struct NumberingFault {
  std::vector<std::string> cameras;  ///< the fewer of the two sides; both when neither is
  std::string what;                  ///< "turned by half a turn", "by a column more", …
  double spread = 0, mended_spread = 0;  ///< of the relative pose, in sizes of the board: as numbered, and renumbered
};

/// One line.
std::string ToString(const NumberingFault& fault);

/// A board that moves gives two cameras the same relative pose in every frame, but only when both number its corners alike. Half a
/// turn and a column or row more or less are tried for each pair of cameras that shares five boards or more; one is believed when it
/// makes the spread of the relative pose four times smaller and less than a tenth of the board. `cam_from_board[v]` belongs to
/// views[v] and comes from that view alone.
std::vector<NumberingFault> FindNumberingFaults(const std::vector<View>& views, const std::vector<geometry::Rigid3>& cam_from_board,
                                                const std::vector<std::string>& camera_names);

}  // namespace mvstudio::calib
