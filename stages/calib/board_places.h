#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "calib/board/board.h"
#include "calib/calibrate.h"
#include "geometry/rigid/rigid3.h"

/// How boards that are rigid to each other lie to the first one, to be compared with a ruler.
namespace mvstudio::stages {

struct BoardPlace {
  double tilt_deg = 0;    ///< between the planes, 0 to 90
  bool opposite = false;  ///< the prints face away from each other: back to back
  double behind_mm = 0;   ///< of the middle of the board, from the first one's plane, away from its reader
  double aside_mm = 0;    ///< between the middles of the boards, along the first one's plane
};

/// Standard deviation of BoardPlace::behind_mm, per board; 0 where it is not known: the first, boards without a place, and
/// calibrations with late cameras.
std::vector<double> BehindSigmasMm(const calib::CalibrateReport& report, const std::vector<calib::Board>& boards);

/// `first_from_board`: pose of the board in the first one (CalibrateReport::rig_from_board).
BoardPlace PlaceOf(const calib::Board& first, const calib::Board& board, const geometry::Rigid3& first_from_board);

/// The boards of a calibration.
struct PlacedBoards {
  const std::vector<calib::Board>& boards;
  const std::vector<geometry::Rigid3>& first_from_board;
  std::vector<double> behind_sigmas_mm;
  std::vector<int> front_of;  ///< per board: the one whose back it is, see calib/board/sides.h; -1: none
};

/// One object for every board after the first; empty for a single board. A board that nothing links to the first has no place
/// and stands as null.
nlohmann::ordered_json BoardPlacesJson(const PlacedBoards& placed);
/// One line for each of them.
std::string BoardPlacesText(const PlacedBoards& placed);

}  // namespace mvstudio::stages
