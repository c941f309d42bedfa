#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "geometry/camera.h"
#include "geometry/rigid3.h"

namespace mvstudio::geometry {

/// A camera in its place, with what is known of its uncertainty.
struct RigCamera {
  Camera camera;
  Rigid3 cam_from_world;
  std::optional<Eigen::MatrixXd> params_covariance;                      // (P, P), units of Camera::params
  std::optional<Eigen::Matrix<double, 6, 6>> cam_from_world_covariance;  // left perturbation: rotation rad, translation m

  /// Camera centre in world, metres.
  Eigen::Vector3d CenterInWorld() const { return Inverse(cam_from_world).translation; }
};

/// All cameras of a studio in one world frame: right-handed, metres, z up where the world is known.
struct Rig {
  std::vector<RigCamera> cameras;
  std::string gauge;  ///< what fixes the world frame and hence the covariances, in words: "camera 00_00", "board in frame 0", …

  /// Covariance of all cameras together, with the correlations that the blocks above leave out: for each camera, in order, its
  /// lens parameters and then the six of cam_from_world. Goes stale when cameras are changed or dropped: see HasJointCovariance.
  std::optional<Eigen::MatrixXd> joint_covariance;

  /// Index of the camera called `name`, or -1.
  int Find(const std::string& name) const;
};

/// True when joint_covariance belongs to these very cameras: its diagonal blocks are their own covariances.
bool HasJointCovariance(const Rig& rig);

}  // namespace mvstudio::geometry
