#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "calib/bundle/view.h"

/// Boards that are not rigid to each other.
namespace mvstudio::calib {

/// Gives every board a pose of its own in every time step: View::frame of all lists then counts (board, frame), board by
/// board, and `frames` holds their frame numbers in that order.
void SeparateBoards(const std::vector<std::vector<View>*>& lists, std::vector<int64_t>* frames);

/// Two boards that were seen in two time steps and lay differently to each other.
struct BoardMove {
  int board_a = 0, board_b = 0;
  int64_t before = 0, after = 0;  ///< frame numbers; no time step in between shows both
  double moved_m = 0;             ///< rms shift of the corners of board_b, seen from board_a
};

template <class Visitor>
void VisitFields(Visitor&& visit, const BoardMove& r) {
  visit("board", r.board_b);
  visit("against", r.board_a);
  visit("last_before", r.before);
  visit("first_after", r.after);
  visit("moved_mm", 1e3 * r.moved_m);
}

/// All of them, in the order of time, from a solution with boards of their own (SeparateBoards). Left out are those below a
/// fifth of the largest.
std::vector<BoardMove> FindBoardMoves(const std::vector<View>& views, const RigState& state);

/// "board 2 moved against board 0 by 31 mm between time steps 4 and 5, …"; empty without any.
std::string ToString(const std::vector<BoardMove>& moves);

}  // namespace mvstudio::calib
