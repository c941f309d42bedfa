#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "geometry/rig/rig.h"

/// The covariance that a calibration states, and which parts are missing. Unknown is not zero.
namespace mvstudio::geometry {

/// Covariance of all cameras in the layout of Rig::joint_covariance.
struct StatedCovariance {
  Eigen::MatrixXd joint;            ///< (N, N); rows and columns of unknown blocks are zero and have no meaning
  std::vector<Eigen::Index> begin;  ///< (cameras + 1) first row of each camera: its lens parameters, then six of the pose
  std::vector<bool> lens_known, pose_known;  ///< per camera
  bool correlated = false;                   ///< from joint_covariance; else blocks count as independent

  Eigen::Index PoseRow(size_t camera) const { return begin[camera + 1] - 6; }
  bool Knows(size_t camera) const { return lens_known[camera] && pose_known[camera]; }
  bool AnyKnown() const;
};

StatedCovariance StatedCovarianceOf(const Rig& rig);

/// Stores the known blocks in every camera and removes the unknown ones. Sets joint_covariance where the blocks are
/// correlated and removes it where they are not. Symmetric parts are stored.
void StoreCovariance(const StatedCovariance& stated, Rig* rig);

/// Cameras that lack the covariance of their lens, their pose or both, in the rig's order.
std::vector<std::string> CamerasWithoutCovariance(const Rig& rig);

/// The joint covariance with camera i of `rig` at position order[i]; empty where the rig has none.
std::optional<Eigen::MatrixXd> ReorderedJointCovariance(const Rig& rig, const std::vector<int>& order);

/// The cameras at `indices`, with their stated covariances.
Rig SubsetOf(const Rig& rig, const std::vector<size_t>& indices);

/// The rig in another world: x_in_new = scale * R x_in_world + t with `new_from_world` (R, t); for `scale` > 0 all
/// projections stay. Covariances are carried as for an exact transform (J S J^T): they stay relative to what fixed the old
/// world.
Rig InWorld(const Rig& rig, const Rigid3& new_from_world, double scale = 1);

/// The rig with the world's origin moved by `offset`: x_new = x - offset, with all covariances. Keeps the precision of
/// rigs far from the world's origin.
Rig MovedWorld(const Rig& rig, const Eigen::Vector3d& offset);

}  // namespace mvstudio::geometry
