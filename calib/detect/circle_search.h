#pragma once

#include <Eigen/Core>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "calib/board/board.h"
#include "core/image.h"

namespace mvstudio::calib {

/// A dark spot with the outline of an ellipse: x with (x - px)^T shape^-1 (x - px) = 1.
struct Spot {
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  Eigen::Matrix2d shape = Eigen::Matrix2d::Identity();  ///< px^2

  double area_px() const;
};

/// Dark spots on light ground of 5 px across or more, by thresholds that follow the brightness around.
std::vector<Spot> FindSpots(const Image& grey);

/// Spots in rows and columns. Cell (i, j) -> spot; i runs along x of the lattice, j along y, and x cross y points away from
/// the viewer.
using SpotLattice = std::map<std::pair<int, int>, int>;
/// Sets of neighbours of neighbours with 4 spots or more, the largest first.
std::vector<SpotLattice> FindLattices(const std::vector<Spot>& spots);

/// The spot of each circle of the board, by number; of a board that looks alike in several turns in the one whose x axis points
/// most to the right. Empty when the lattice does not hold the whole board, or more than it in its rows.
std::vector<int> CirclesInLattice(const Board& board, const SpotLattice& lattice, const std::vector<Spot>& spots);

/// The grid of circles (square_m = 1), symmetric or not, that the lattice is as a whole.
std::optional<Board> GuessCircles(const SpotLattice& lattice);

}  // namespace mvstudio::calib
