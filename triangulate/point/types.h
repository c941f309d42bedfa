#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/status.h"

namespace mvstudio::triangulate {

/// One detection of a point by a camera, with its accuracy.
struct Observation {
  int camera_idx = 0;
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  double sigma_px = 1;  ///< standard deviation of each coordinate
  double score = 1;     ///< the detector's confidence; used by the exhaustive DLT only
};

/// A triangulated point. Position, covariance and residuals are valid only when `status` is kOk.
struct Point {
  Status status = Status::kTooFewViews;
  Eigen::Vector3d x_in_world = Eigen::Vector3d::Zero();  ///< metres
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  ///< m^2, from the observations' sigmas and the calibration's
                                                         ///< covariance
  Eigen::Matrix3d calibration_covariance = Eigen::Matrix3d::Zero();  ///< m^2, the calibration's share of `covariance`
  int num_unknown_cameras = 0;  ///< cameras used for the point whose calibration error is unknown and not in `covariance`
  int num_observations = 0;                              ///< number of observations given
  std::vector<int> used;                                 ///< indices of the observations used for the point, ascending
  double rms_px = 0;                                     ///< sqrt(mean |r|^2) over `used`
  double chi_squared = 0;                                ///< sum |r|^2 / sigma^2 over `used`; 2 |used| - 3 degrees of freedom
};

}  // namespace mvstudio::triangulate
