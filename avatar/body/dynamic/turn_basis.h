#pragma once

#include <vector>

#include "avatar/body/articulated_pose.h"

namespace mvstudio::body {

/// Directions in which the bones' local rotations vary most.
struct TurnBasis {
  Eigen::VectorXd mean;     ///< (9 (B - 1)) entries of the local rotations less identity, as BodyTemplate::pose_directions
  Eigen::MatrixXd to_unit;  ///< (K, 9 (B - 1)); a pose's values are to_unit * (turns - mean)

  Eigen::Index size() const { return to_unit.rows(); }
  Eigen::VectorXd Values(const ArticulatedPose& pose) const;  ///< (K)
};

/// (9 (B - 1)) entries of the local rotations of bones 1 to B - 1 less identity, row by row.
Eigen::VectorXd TurnsOf(const ArticulatedPose& pose);

/// Principal components of the poses' turns, at most `most`. Those that hardly vary are left out: they would say nothing of
/// other poses. A value of one is a standard deviation of the poses, or more where they vary little.
TurnBasis FindTurnBasis(const std::vector<ArticulatedPose>& poses, int most);

}  // namespace mvstudio::body
