#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "calib/keypoints/fit.h"
#include "core/status.h"

namespace mvstudio::calib {

/// What may move when a rig is adjusted to key points.
struct KeypointFreedom {
  std::vector<bool> fix_pose;                    ///< per camera; empty: all poses are free
  std::vector<Eigen::MatrixXd> lens_directions;  ///< per camera (P, K), see PointBundleOptions; empty: lenses are held
};

struct KeypointSolution {
  Status status = Status::kOk;  ///< kTooFewViews, kNotConverged
  std::string message;          ///< one line when the status is not kOk
  geometry::Rig rig;            ///< frame and scale near those of the start where nothing holds them; no covariances
  double cauchy_px = 0;         ///< scale of the noise, see KeypointCost
  double cost = 0;              ///< over all joints with two views or more
  int num_joints = 0, num_observations = 0;
};

/// Adjusts cameras to joints whose points are the eliminated unknowns, under the cost of KeypointCost. With `cauchy_px` 0 its
/// scale is estimated from the residuals: the first round takes plain squares, so that a start that is off by tens of px has a
/// smooth way down, and the scale falls with the residuals. Points are looked for anew in every round in
/// which the cameras moved. The first rounds of large problems see a part of the frames alone. `start_fits`: the joints' fits
/// at the start (FitKeypoints with this `cauchy_px` and two views); then points keep to the minima known from there.
KeypointSolution SolveKeypoints(const geometry::Rig& start, const std::vector<KeypointJoint>& joints,
                                const KeypointFreedom& freedom, double cauchy_px, int num_threads,
                                const std::vector<KeypointFit>* start_fits = nullptr);

struct KeypointCovariance {
  Status status = Status::kOk;  ///< kDegenerate: something is held by nothing, see `message`
  std::string message;
  Eigen::MatrixXd joint;   ///< for each camera its lens parameters and the six of cam_from_world (left perturbation)
  std::vector<int> begin;  ///< (cameras + 1) first row of each camera in `joint`
  Eigen::MatrixXd from_joints;               ///< `joint` for an exact given calibration
  std::vector<bool> lens_known, pose_known;  ///< per camera: false for what was held and whose error is not given
};

/// Covariance at a solution. The frame, when no pose is fixed, is that of AlignToGiven: mean, turn and size of the camera
/// centres are held. Its shape is that of the Cauchy cost's curvature. Joints of a frame, and frames of a stretch of time, err
/// together, and with three or four views a point follows its noise: its size is that of a jackknife over ten stretches of the
/// take (Efron and Stein, 1981), one factor on all variances. `given`, the rig that the solution started from, states the errors of
/// what was held: they go on into what was adjusted (CovarianceWithHeld). Null: it states nothing.
KeypointCovariance CovarianceOfKeypoints(const KeypointSolution& solution, const std::vector<KeypointJoint>& joints,
                                         const KeypointFreedom& freedom, int num_threads, const geometry::Rig* given = nullptr);

/// Derivative (3, 6) of a camera's centre -R^T t in world by its pose (left perturbation).
Eigen::Matrix<double, 3, 6> CentreFromPose(const geometry::Rigid3& cam_from_world);

/// Covariance of a camera's centre in world from that of its pose (left perturbation).
Eigen::Matrix3d CentreCovariance(const geometry::Rigid3& cam_from_world, const Eigen::Matrix<double, 6, 6>& covariance);

/// The rig in the frame and scale of `given`: least squares of the camera centres over a similarity. Where these lie on a line
/// (two cameras), their distances give the scale and the mean of the cameras' orientations the turn.
geometry::Rig AlignToGiven(const geometry::Rig& rig, const geometry::Rig& given);

/// True when the camera centres span a plane, so that AlignToGiven needs nothing but them.
bool CentresHoldFrame(const geometry::Rig& rig);

}  // namespace mvstudio::calib
