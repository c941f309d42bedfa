// Private: how sure RefineOffsets may be.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "triangulate/sync/timed_points.h"

namespace mvstudio::triangulate::internal {

/// Noise of the tracks: of their samples, which neighbouring samples share, and of their slopes. Both are what the points, or
/// the points' velocities, do not explain.
struct TrackNoise {
  double sigma_px = 0;              ///< of a sampled coordinate
  double sigma_px_per_frame = 0;    ///< of a coordinate of a sampled slope
  std::vector<double> correlation;  ///< of a sampled coordinate with itself, by lag in the frames that are looked at; [0] is 1
};

/// Variances (4 C) of the unknowns from the noise of the tracks, and the inverse of the information that they have.
struct ClockVariances {
  TrackNoise noise;
  Eigen::MatrixXd inverse;  ///< (4 C, 4 C)
  Eigen::VectorXd by_noise;
  Eigen::VectorXd by_calibration;  ///< from the covariance that the rig states, in addition
};

/// `information` (4 C, 4 C) is Gauss-Newton's of all clocks, points eliminated. Slopes that are noise look like motion: what
/// that adds to it is taken off. `held` unknowns stay where they are and have rows and columns of the identity. Only offsets
/// and drifts get a variance. NaN where the information is singular.
ClockVariances MeasureClockVariances(const PreparedRig& rig, const std::vector<TimedPoint>& points,
                                     const Eigen::MatrixXd& information, const std::vector<Eigen::Index>& held);

}  // namespace mvstudio::triangulate::internal
