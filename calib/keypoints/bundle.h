#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "calib/keypoints/fit.h"
#include "core/status.h"

namespace mvstudio::calib {

/// Free unknowns when a rig is adjusted to keypoints.
struct KeypointFreedom {
  std::vector<bool> fix_pose;                    ///< per camera; empty: all poses are free
  std::vector<Eigen::MatrixXd> lens_directions;  ///< per camera (P, K), see PointBundleOptions; empty: lenses are fixed
};

struct KeypointSolution {
  Status status = Status::kOk;  ///< kTooFewViews, kBehindCamera, kNotConverged
  std::string message;          ///< one line when the status is not kOk
  geometry::Rig rig;            ///< frame and scale near those of the start where no data fix them; no covariances
  double cauchy_px = 0;         ///< scale of the noise, see KeypointCost
  double cost = 0;              ///< over all joints with two views or more
  int num_joints = 0, num_observations = 0;
};

/// Adjusts cameras to joints under KeypointCost, with the points eliminated. With `cauchy_px` 0 its scale is estimated
/// from the residuals. The first round then uses plain squares, so that a start that is wrong by tens of px converges, and
/// the scale falls with the residuals. Points are searched again in every round in which the cameras moved. The first
/// rounds of large problems use only part of the frames. `start_fits`: the joints' fits at the start (FitKeypoints with
/// this `cauchy_px` and two views); points then keep to these known minima.
KeypointSolution SolveKeypoints(const geometry::Rig& start, const std::vector<KeypointJoint>& joints,
                                const KeypointFreedom& freedom, double cauchy_px, int num_threads,
                                const std::vector<KeypointFit>* start_fits = nullptr);

struct KeypointCovariance {
  Status status = Status::kOk;  ///< kDegenerate: some unknown is not determined, see `message`
  std::string message;
  Eigen::MatrixXd joint;          ///< for each camera its lens parameters and the six of cam_from_world (left perturbation)
  std::vector<int> begin;         ///< (cameras + 1) first row of each camera in `joint`
  Eigen::MatrixXd from_joints;    ///< `joint` for an exact given calibration
  Eigen::MatrixXd from_geometry;  ///< the same from the views that fit together and their noise: J^T J alone
  std::vector<bool> lens_known, pose_known;  ///< per camera: false for what was fixed and whose covariance is not given
};

/// Covariance at a solution. Without a fixed pose the frame is that of AlignToGiven: mean, rotation and scale of the
/// camera centres are fixed.
///
/// What is determined is judged by J^T J of the inliers. The shape is the curvature of the Cauchy cost, or that J^T J where the
/// cost is not curved in some direction, as at a bad solution; the size is one factor on all variances from a jackknife over
/// ten intervals of the take (Efron and Stein, 1981). The reason: errors of joints in a frame, and of frames close in time, are
/// correlated, and with three or four views a point follows its noise.
///
/// `given`, the rig that the solution started from, states the covariance of what was fixed, which propagates to what was
/// adjusted (CovarianceWithHeld). Null: nothing is stated.
KeypointCovariance CovarianceOfKeypoints(const KeypointSolution& solution, const std::vector<KeypointJoint>& joints,
                                         const KeypointFreedom& freedom, int num_threads, const geometry::Rig* given = nullptr);

/// Derivative (3, 6) of a camera's centre -R^T t, in world, with respect to its pose (left perturbation).
Eigen::Matrix<double, 3, 6> CentreFromPose(const geometry::Rigid3& cam_from_world);

/// Covariance of a camera's centre in world from that of its pose (left perturbation).
Eigen::Matrix3d CentreCovariance(const geometry::Rigid3& cam_from_world, const Eigen::Matrix<double, 6, 6>& covariance);

/// The rig in the frame and scale of `given`, by the least-squares similarity of the camera centres. Where these are
/// collinear (two cameras), their distances give the scale and the mean of the cameras' orientations the rotation.
geometry::Rig AlignToGiven(const geometry::Rig& rig, const geometry::Rig& given);

/// True when the camera centres span a plane, so that they suffice for AlignToGiven.
bool CentresHoldFrame(const geometry::Rig& rig);

}  // namespace mvstudio::calib
