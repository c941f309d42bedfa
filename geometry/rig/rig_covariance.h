#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "geometry/rig/rig.h"

/// What a calibration states of its own errors, with what it leaves unsaid. Unknown is not zero.
namespace mvstudio::geometry {

/// Covariance of all cameras in the layout of Rig::joint_covariance.
struct StatedCovariance {
  Eigen::MatrixXd joint;                     ///< (N, N); rows and columns of unknown blocks are zero and mean nothing
  std::vector<Eigen::Index> begin;           ///< (cameras + 1) first row of each camera: its lens parameters, then six of the pose
  std::vector<bool> lens_known, pose_known;  ///< per camera
  bool correlated = false;                   ///< from joint_covariance; else blocks count as independent

  Eigen::Index PoseRow(size_t camera) const { return begin[camera + 1] - 6; }
  bool Knows(size_t camera) const { return lens_known[camera] && pose_known[camera]; }
  bool AnyKnown() const;
};

StatedCovariance StatedCovarianceOf(const Rig& rig);

/// Gives every camera its known blocks and takes away the unknown ones; sets joint_covariance where the blocks are correlated, and
/// takes it away where they are not. Symmetric parts are stored.
void StoreCovariance(const StatedCovariance& stated, Rig* rig);

/// Cameras that lack the covariance of their lens, their pose or both, in the rig's order.
std::vector<std::string> CamerasWithoutCovariance(const Rig& rig);

/// The joint covariance with camera i of `rig` at place order[i]; nothing where the rig has none.
std::optional<Eigen::MatrixXd> ReorderedJointCovariance(const Rig& rig, const std::vector<int>& order);

/// The cameras at `indices`, with what the rig states of them.
Rig SubsetOf(const Rig& rig, const std::vector<size_t>& indices);

/// World moved by `offset`: x_new = x - offset, with all covariances. Keeps the digits of rigs far from the world's origin.
Rig MovedWorld(const Rig& rig, const Eigen::Vector3d& offset);

}  // namespace mvstudio::geometry
