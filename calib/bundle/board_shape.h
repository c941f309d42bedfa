#pragma once

#include <Eigen/Core>
#include <vector>

#include "calib/board/board.h"
#include "calib/bundle/view.h"
#include "geometry/rig/rig.h"

/// Board shapes estimated by a calibration: warped and stretched.
namespace mvstudio::calib {

/// Shapes of the boards that are not nominal, for the calibration file.
std::vector<geometry::RigBoard> ShapesOf(const std::vector<Board>& boards, const RigState& state);

/// Corners (3, num_corners()) in the frame board, metres, with the shape that `shapes` states for a board of this
/// description. Nominal where no shape is stated. Also nominal for boards of single points, because their descriptions do
/// not distinguish them.
Eigen::Matrix3Xd ShapedCorners(const Board& board, const std::vector<geometry::RigBoard>& shapes);

}  // namespace mvstudio::calib
