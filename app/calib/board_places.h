#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "calib/board/board.h"
#include "geometry/rigid/rigid3.h"

/// How boards that are rigid to each other lie to the first one, to be compared with a ruler.
namespace mvstudio::app {

struct BoardPlace {
  double tilt_deg = 0;    ///< between the planes, 0 to 90
  bool opposite = false;  ///< the prints face away from each other: back to back
  double behind_mm = 0;   ///< of the middle of the board, from the first one's plane, away from its reader
  double aside_mm = 0;    ///< between the middles of the boards, along the first one's plane
};

/// `first_from_board`: pose of the board in the first one (CalibrateReport::rig_from_board).
BoardPlace PlaceOf(const calib::Board& first, const calib::Board& board, const geometry::Rigid3& first_from_board);

/// One object for every board after the first; empty for a single board. A board that nothing links to the first has no place
/// and stands as null.
nlohmann::ordered_json BoardPlacesJson(const std::vector<calib::Board>& boards,
                                       const std::vector<geometry::Rigid3>& first_from_board);
/// One line for each of them.
std::string BoardPlacesText(const std::vector<calib::Board>& boards, const std::vector<geometry::Rigid3>& first_from_board);

}  // namespace mvstudio::app
