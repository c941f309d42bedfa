#pragma once

#include <Eigen/Core>

#include "geometry/rig/rig.h"

/// Where a rig's cameras look, and poses that a file gives the other way round.
namespace mvstudio::geometry {

/// The point that is nearest to the optical axes of all cameras.
struct AxesMeeting {
  bool determined = false;  ///< false: fewer than two cameras, or parallel axes
  Eigen::Vector3d x_in_world = Eigen::Vector3d::Zero();
  double mean_distance_m = 0;  ///< of the cameras from it
  double miss_m = 0;           ///< rms distance of the axes from it
  double spread_m = 0;         ///< of the cameras' centres, rms about their mean
  int in_front = 0;            ///< cameras that have it in front of them

  /// The axes meet: they miss the point by less than a tenth of its distance, from places that are not one.
  bool sharp() const { return determined && miss_m < 0.1 * mean_distance_m && spread_m > 0.1 * mean_distance_m; }
};
AxesMeeting MeetingOfAxes(const Rig& rig);

/// The rig whose file gives world_from_cam where cam_from_world is meant: every pose inverted. `world_from_file` is the turn
/// from the file's world to the rig's. Covariances are dropped.
Rig WithPosesInverted(Rig rig, const Eigen::Matrix3d& world_from_file = Eigen::Matrix3d::Identity());

/// The rig whose file has the rotations transposed (rows for columns), the translations as they should be. Covariances are
/// dropped.
Rig WithRotationsTransposed(Rig rig);

/// The rig whose file is left-handed (x right, y up, z forward, in world and cameras): y is turned over in both, which leaves
/// what the cameras see as it is. Covariances are dropped.
Rig WithAxesMirrored(Rig rig);

/// Cameras that look along -z with y up (OpenGL) instead: each is turned by half a turn about its x axis.
Rig WithAxesRotated(Rig rig);

}  // namespace mvstudio::geometry
