#include "calib/bundle/board_shape.h"

namespace mvstudio::calib {

std::vector<geometry::RigBoard> ShapesOf(const std::vector<Board>& boards, const RigState& state) {
  std::vector<geometry::RigBoard> shapes;
  for (size_t b = 0; b < boards.size(); ++b) {
    geometry::RigBoard shape;
    shape.board = ToString(boards[b]);
    if (b < state.board_warp_m.size()) shape.bend_m = state.board_warp_m[b];
    if (b < state.board_stretch.size()) shape.stretch = state.board_stretch[b];
    if (!shape.bend_m.isZero(0) || !shape.stretch.isZero(0)) shapes.push_back(shape);
  }
  return shapes;
}

Eigen::Matrix3Xd ShapedCorners(const Board& board, const std::vector<geometry::RigBoard>& shapes) {
  View all;
  all.x_in_board = CornersInBoard(board);
  all.warp_basis = WarpBasis(all.x_in_board);
  if (board.kind == Board::Kind::kPoints) return all.x_in_board;
  for (const geometry::RigBoard& shape : shapes) {
    if (shape.board != ToString(board)) continue;
    RigState state;
    state.board_warp_m = {shape.bend_m}, state.board_stretch = {shape.stretch};
    return BentCorners(all, state);
  }
  return all.x_in_board;
}

}  // namespace mvstudio::calib
