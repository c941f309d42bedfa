// Private: whether located corners lie on the smooth image of a board.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "calib/board/homography.h"
#include "calib/detect/locate_board.h"

namespace mvstudio::calib {

inline constexpr size_t kPieceCorners = 60;  ///< at most; as many as a usual chessboard has, so that one piece holds it

/// Smooth image of the located corners nearest to board position `at`, of all when they are few. A strong lens bends a large
/// board more than one PlaneToImage follows, and more squares away from a homography than corners on wrong squares are.
std::optional<PlaneToImage> PlaneAround(const Located& located, const Eigen::Vector2d& at,
                                        const std::vector<Eigen::Index>& among);

/// How the located corners lie on smooth pieces, each of the corners nearest to its middle, which overlap.
struct BoardSurface {
  bool on_one_line = false;  ///< no piece can be fitted; nothing else is set
  double off_px = 0;       ///< median distance of a piece's corners from its homography, in the piece that is the furthest off
  double off_squares = 0;  ///< the same in squares
  double sigma_px = 0;     ///< usual distance from the smooth pieces, per coordinate
  std::vector<bool> held;  ///< per corner: on its piece, and this is joined with the largest part of the board
};
BoardSurface FitSurface(const Located& located);

}  // namespace mvstudio::calib
