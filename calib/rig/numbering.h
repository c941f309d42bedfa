#pragma once

#include <string>
#include <vector>

#include "calib/bundle/view.h"

namespace mvstudio::calib {

/// Cameras that number a board's corners differently from the others.
struct NumberingFault {
  std::vector<std::string> cameras;      ///< the smaller of the two sides; both when they are equal
  std::string what;                      ///< "turned by half a turn", "by a column more", …
  double spread = 0, mended_spread = 0;  ///< spread of the relative pose, in board sizes: as numbered, and after renumbering
};

/// One line.
std::string ToString(const NumberingFault& fault);

/// Finds cameras that number a board's corners differently. A moving board gives two cameras the same relative pose in
/// every frame only if both number its corners alike. Half a turn and one column or row more or less are tried for each
/// pair of cameras that shares five or more boards. A renumbering is accepted if it makes the spread of the relative pose
/// four times smaller, and less than a tenth of the board. `cam_from_board[v]` belongs to views[v] and comes from that
/// view alone.
std::vector<NumberingFault> FindNumberingFaults(const std::vector<View>& views,
                                                const std::vector<geometry::Rigid3>& cam_from_board,
                                                const std::vector<std::string>& camera_names);

/// Whether views of these boards may be numbered from the other end: one chessboard or grid.
bool CanBeTurned(const std::vector<Board>& boards);

/// Views that number the board from the other end than the others of their frame: one flag a view. A detector of chessboards
/// that look the same after half a turn numbers every image by itself. A moving board gives two cameras one relative pose
/// over three frames or more, once the turned views are known; in each frame the fewer views count as turned, of two the
/// later camera's. Frames after each other are numbered alike, so that the board does not seem to turn in between. A view stays as it is where that cannot be said: where the turn does not bring its board four times
/// nearer to where the other camera puts it, or where the board did not move. For a single board, whose corners run row by
/// row. `cam_from_world`, per camera where poses are known, decides where it explains most of a pair's frames.
std::vector<bool> FindTurnedViews(const std::vector<View>& views, const std::vector<geometry::Rigid3>& cam_from_board,
                                  const std::vector<geometry::Rigid3>* cam_from_world = nullptr);

/// Numbers the corners of these views from the other end, the pose with them. `board`: (3, N) corners of the whole board.
void TurnViews(const Eigen::Matrix3Xd& board, const std::vector<bool>& turned, std::vector<View>* views,
               std::vector<geometry::Rigid3>* cam_from_board);

/// How many views of a camera were turned.
struct TurnedCamera {
  std::string camera;
  int num_turned = 0, num_views = 0;
};

/// One line.
std::string NumberingText(const TurnedCamera& camera);

}  // namespace mvstudio::calib
