#pragma once

#include <Eigen/Core>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "stages/view/body_colours.h"
#include "stages/view/moving_body.h"
#include "stages/view/scene.h"

/// What stands in the studio beside joints: boards and the fitted body.
namespace mvstudio::stages {

/// A board at one time step, metres in world.
struct PlacedBoard {
  Eigen::Matrix3Xd corners;  ///< (3, N)
  Eigen::Matrix3Xd outline;  ///< (3, 4) around the corners, one after the other; empty where they lie in no plane
  Eigen::Matrix3Xd axes;     ///< (3, 3): origin, the ends of x and y
};

struct OverlaySolids {
  std::map<int, std::vector<PlacedBoard>> boards;  ///< by time step
  std::optional<MovingBody> body;
  std::optional<BodyColours> colours;  ///< of that body
};

/// Those of one time step.
struct SolidsNow {
  std::vector<PlacedBoard> boards;
  Eigen::Matrix3Xd vertices;  ///< (3, V) metres in world; empty: no body
  Eigen::Matrix3Xi faces;     ///< (3, F)
};
SolidsNow SolidsAt(const OverlaySolids& solids, int step);

/// Which of them are read.
struct SolidsWanted {
  bool boards = true, body = true;
};

/// Boards of a take that films them, by board_poses.csv beside the session's calibration; the body of body_motion.bin in the
/// take's avatar, or in a run. What is there and cannot be read is a warning.
OverlaySolids ReadSolids(const ViewSceneOptions& options, const SolidsWanted& wanted, const Scene& scene, InputNotes* notes);

/// The rows of a board_poses.csv by time step. `boards`: as the session states them. Throws IoError, FormatError, UsageError.
std::map<int, std::vector<PlacedBoard>> ReadPlacedBoards(const std::string& path, const std::string& boards);

}  // namespace mvstudio::stages
