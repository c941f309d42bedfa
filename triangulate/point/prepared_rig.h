#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "geometry/rig/rig.h"
#include "triangulate/point/types.h"

namespace mvstudio::triangulate {

/// A camera ready for triangulation. `local` has the axes of world and its origin between the cameras, so that a rig far
/// from the world's origin (map coordinates) loses no precision.
struct PreparedCamera {
  std::string name;
  geometry::Projector projector;
  Eigen::Matrix3d cam_from_local_rotation;
  Eigen::Vector3d cam_from_local_translation;  // metres
  Eigen::Vector3d center_in_local;             // metres
  double focal_px = 0;
  double rounding_m = 0;  // error of the centre from the size of the numbers alone

  Eigen::Vector3d ToCam(const Eigen::Vector3d& x_in_local) const {
    return cam_from_local_rotation * x_in_local + cam_from_local_translation;
  }
};

/// A rig ready for triangulation. Immutable; may be shared by threads.
struct PreparedRig {
  Eigen::Vector3d origin_in_world = Eigen::Vector3d::Zero();  // metres
  std::vector<PreparedCamera> cameras;
  std::vector<int> duplicate_of;  ///< per camera: an earlier camera with the same lens and pose, or -1
  /// Covariance of the calibration: for each camera its lens parameters and the six of cam_from_world (left perturbation).
  /// Empty when the rig states none or its lenses are ignored. Without joint_covariance the blocks count as independent,
  /// which overstates the error, because errors of a lens and its pose are correlated. Rows of a missing block are zero,
  /// which means unknown: see covariance_known.
  Eigen::MatrixXd covariance;
  std::vector<Eigen::Index> covariance_begin;  ///< (cameras + 1) first row of each camera
  std::vector<bool> covariance_known;          ///< per camera: of its lens and its pose
};

/// With `ignore_distortion`, every lens becomes a pinhole with its own focal lengths and principal point.
PreparedRig Prepare(const geometry::Rig& rig, bool ignore_distortion = false);

/// An observation with its ray. `camera` points into the PreparedRig.
struct View {
  const PreparedCamera* camera = nullptr;
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  double sigma_px = 1;
  double sigma_rad = 1;                                     // sigma_px over the focal length
  Eigen::Vector3d ray_in_local = Eigen::Vector3d::UnitZ();  // unit length
  int observation_idx = 0;
};

/// Views of the observations that have a ray; of two observations of one pixel by the same camera under two names, the
/// first. `rejected` receives the reason for the first observation without a ray (kOk when all have one): kNonFiniteInput,
/// kOutsideValidRadius.
std::vector<View> MakeViews(const PreparedRig& rig, const std::vector<Observation>& observations, Status* rejected);

}  // namespace mvstudio::triangulate
