#pragma once

#include <Eigen/Core>
#include <vector>

#include "calib/board/board.h"
#include "calib/bundle/view.h"
#include "geometry/rig/rig.h"

/// Boards as a calibration found them: bent and stretched.
namespace mvstudio::calib {

/// The shapes of the boards where they are not nominal, for the calibration file.
std::vector<geometry::RigBoard> ShapesOf(const std::vector<Board>& boards, const RigState& state);

/// Corners (3, num_corners()) in the frame board, metres, in the shape that `shapes` states for a board of this text; nominal
/// where it states none, and for boards of single points, whose text does not tell them apart.
Eigen::Matrix3Xd ShapedCorners(const Board& board, const std::vector<geometry::RigBoard>& shapes);

}  // namespace mvstudio::calib
