#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "geometry/lens/camera.h"
#include "geometry/rigid/rigid3.h"

namespace mvstudio::geometry {

/// Frame `f` of the rig and frame `f + frames` of the camera show the same instant, as in sync.json. Of the recording that the
/// calibration was made from: it holds for another one when the cameras kept their clocks.
struct TimeOffset {
  double frames = 0;
  double sigma_frames = 0;
};

/// A camera in its place, with what is known of its uncertainty. A covariance that is absent is unknown, not zero.
struct RigCamera {
  Camera camera;
  Rigid3 cam_from_world;
  std::optional<Eigen::MatrixXd> params_covariance;                      // (P, P), units of Camera::params
  std::optional<Eigen::Matrix<double, 6, 6>> cam_from_world_covariance;  // left perturbation: rotation rad, translation m
  std::optional<TimeOffset> time_offset = std::nullopt;                  // none: not estimated

  /// Camera centre in world, metres.
  Eigen::Vector3d CenterInWorld() const { return Inverse(cam_from_world).translation; }
};

/// The shape of a board as a calibration found it, where that is not the nominal one.
struct RigBoard {
  std::string board;                                  ///< the text that calib::ParseBoard reads
  Eigen::Vector2d bend_m = Eigen::Vector2d::Zero();   ///< of calib::WarpBasis
  Eigen::Vector2d stretch = Eigen::Vector2d::Zero();  ///< shear s and aspect a: x' = (1 + a) x + s y, y' = s x + (1 - a) y
};

/// All cameras of a studio in one world frame: right-handed, metres, z up where the world is known.
struct Rig {
  std::vector<RigCamera> cameras;
  std::string gauge;  ///< what fixes the world frame and hence the covariances, in words: "camera 00_00", "board in frame 0", …

  /// Covariance of all cameras together, with the correlations that the blocks above leave out: for each camera, in order, its
  /// lens parameters and then the six of cam_from_world. Goes stale when cameras are changed or dropped: see
  /// HasJointCovariance.
  std::optional<Eigen::MatrixXd> joint_covariance;

  std::vector<RigBoard> boards;  ///< what the calibration says of its boards' shape; empty: nothing, they count as nominal

  /// Index of the camera called `name`, or -1.
  int Find(const std::string& name) const;
};

/// In the rig's order.
std::vector<std::string> CameraNames(const Rig& rig);
std::vector<std::string> CameraNames(const std::vector<Camera>& cameras);

/// True when joint_covariance belongs to these very cameras: its diagonal blocks are the covariances that they have. Blocks
/// that a camera does not have are unknown: its rows there mean nothing (StatedCovarianceOf in geometry/rig/rig_covariance.h).
bool HasJointCovariance(const Rig& rig);

}  // namespace mvstudio::geometry
