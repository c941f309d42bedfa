#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "geometry/lens/camera.h"
#include "geometry/rig/rig_gauge.h"
#include "geometry/rigid/rigid3.h"

namespace mvstudio::geometry {

/// Frame `f` of the rig and frame `f + frames + rate * f` of the camera show the same time step, as in sync.json. Valid for
/// the recording of the calibration; for another one only if the cameras kept their clocks.
struct TimeOffset {
  double frames = 0;
  double sigma_frames = 0;
  double rate = 0;  ///< frames per frame: of a clock that runs at another rate than the others
  double sigma_rate = 0;

  double At(double frame) const { return frames + rate * frame; }
};

/// A camera with its pose and its uncertainty. An absent covariance is unknown, not zero.
struct RigCamera {
  Camera camera;
  Rigid3 cam_from_world;
  std::optional<Eigen::MatrixXd> params_covariance;                      // (P, P), units of Camera::params
  std::optional<Eigen::Matrix<double, 6, 6>> cam_from_world_covariance;  // left perturbation: rotation rad, translation m
  std::optional<TimeOffset> time_offset = std::nullopt;                  // none: not estimated

  /// Camera centre in world, metres.
  Eigen::Vector3d CenterInWorld() const { return Inverse(cam_from_world).translation; }
};

/// The shape of a board as estimated by a calibration, where it is not nominal.
struct RigBoard {
  std::string board;                                  ///< the text that calib::ParseBoard reads
  Eigen::Vector2d bend_m = Eigen::Vector2d::Zero();   ///< warp, coefficients of calib::WarpBasis
  Eigen::Vector2d stretch = Eigen::Vector2d::Zero();  ///< shear s and aspect a: x' = (1 + a) x + s y, y' = s x + (1 - a) y
};

/// All cameras of a studio in one world frame: right-handed, metres, z up where the world is known.
struct Rig {
  std::vector<RigCamera> cameras;
  RigGauge gauge;

  /// Covariance of all cameras together, with the correlations that the blocks above omit: for each camera, in order, its
  /// lens parameters and then the six of cam_from_world. Becomes stale when cameras are changed or removed: see
  /// HasJointCovariance.
  std::optional<Eigen::MatrixXd> joint_covariance;

  std::vector<RigBoard> boards;  ///< board shapes that the calibration states; empty: nominal

  /// Index of the camera called `name`, or -1.
  int Find(const std::string& name) const;
};

/// In the rig's order.
std::vector<std::string> CameraNames(const Rig& rig);
std::vector<std::string> CameraNames(const std::vector<Camera>& cameras);

/// True when joint_covariance belongs to these cameras: its diagonal blocks are the covariances that they have. Rows of
/// blocks that a camera lacks are unknown and have no meaning (StatedCovarianceOf in geometry/rig/rig_covariance.h).
bool HasJointCovariance(const Rig& rig);

}  // namespace mvstudio::geometry
