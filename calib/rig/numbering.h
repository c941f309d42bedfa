#pragma once

#include <string>
#include <vector>

#include "calib/bundle/view.h"

namespace mvstudio::calib {

/// Cameras that number a board's corners differently from the others.
struct NumberingFault {
  std::vector<std::string> cameras;      ///< the smaller of the two sides; both when they are equal
  std::string what;                      ///< "turned by half a turn", "shifted by a column", …
  double spread = 0, mended_spread = 0;  ///< spread of the relative pose, in board sizes: as numbered, and after renumbering
};

/// One line.
std::string ToString(const NumberingFault& fault);

/// Finds cameras that number a board's corners differently. A moving board gives two cameras the same relative pose in
/// every frame only if both number its corners alike. Half a turn, of a square board also a quarter, and one column or row
/// more or less are tried for each pair of cameras that shares five or more boards. A renumbering is accepted if it makes the
/// spread of the relative pose four times smaller, and less than a tenth of the board. `cam_from_board[v]` belongs to views[v]
/// and comes from that view alone.
std::vector<NumberingFault> FindNumberingFaults(const std::vector<View>& views,
                                                const std::vector<geometry::Rigid3>& cam_from_board,
                                                const std::vector<std::string>& camera_names);

/// In how many turns the corners of these boards may be numbered: 2 or 4 for one board without markers that looks alike in
/// them, else 1.
int NumNumberings(const std::vector<Board>& boards);

/// Views that number the board from another end than the others of their frame: for each view the quarter turns, 0 to 3, that
/// bring it to their numbering. `num_turns`: NumNumberings; a detector numbers
/// every image of such a board by itself. A moving board gives two cameras one relative pose over three frames or more, once
/// the turned views are known; in each frame the numbering of most views stays, of two the first camera's. Frames after each
/// other are numbered alike, so that the board does not seem to turn in between. A view stays as it is where that cannot be
/// said: where no turn brings its board four times nearer to where the other camera puts it than the others do, or where the
/// board did not move. For a single board, whose corners run row by row. `board`: (3, N) corners of the whole board, nominal.
/// `cam_from_world`, per camera where poses are known, decides where it explains most of a pair's frames.
std::vector<int> FindRotatedViews(const Eigen::Matrix3Xd& board, int num_turns, const std::vector<View>& views,
                                  const std::vector<geometry::Rigid3>& cam_from_board,
                                  const std::vector<geometry::Rigid3>* cam_from_world = nullptr);

/// Numbers the corners of these views anew, the pose with them.
void TurnViews(const Eigen::Matrix3Xd& board, const std::vector<int>& rotated, std::vector<View>* views,
               std::vector<geometry::Rigid3>* cam_from_board);

/// The number of corner `id` after so many quarter turns; an odd number is for boards of as many columns as rows.
int RotatedCorner(int id, int num_corners, int quarters);

/// How many views of a camera were turned.
struct RotatedCamera {
  std::string camera;
  int num_rotated = 0, num_views = 0;
};

/// One line.
std::string NumberingText(const RotatedCamera& camera);

}  // namespace mvstudio::calib
