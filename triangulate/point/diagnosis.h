#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "triangulate/point/prepared_rig.h"
#include "triangulate/point/types.h"

namespace mvstudio::triangulate {

/// Residuals, observed minus projected, of one camera's detections against the points triangulated from all cameras.
struct CameraDiagnosis {
  std::string name;
  int num_detections = 0;                                       ///< of points with status kOk
  int num_rejected = 0;                                         ///< of these, those not used for their point
  Eigen::Vector2d mean_residual_px = Eigen::Vector2d::Zero();   ///< without those farther than 5 robust sigmas
  Eigen::Vector2d sigma_residual_px = Eigen::Vector2d::Zero();  ///< robust standard deviation of a residual
  Eigen::Vector2d mean_error_px = Eigen::Vector2d::Zero();      ///< standard deviation of the mean, one sample per frame
  /// The same against points from the other cameras alone: the whole error of this camera. `mean_residual_px` is smaller,
  /// because the point was fitted to it.
  Eigen::Vector2d mean_left_out_residual_px = Eigen::Vector2d::Zero();
  Eigen::Vector2d image_scale =
      Eigen::Vector2d::Ones();  ///< detections / projections about the principal point, from the left-out residuals
  Eigen::Vector2d image_scale_error = Eigen::Vector2d::Zero();  ///< its standard deviation, one sample per frame
  bool off = false;     ///< the mean is more than 2 px and 4 of its standard deviations away from zero
  bool scaled = false;  ///< the image scale differs from 1 by more than 4 standard deviations and 2 px at the border
  std::string message;  ///< one line, when off or scaled
};

/// A point with its observations.
struct DiagnosedPoint {
  int frame = 0;
  const Point* point = nullptr;
  const std::vector<Observation>* observations = nullptr;
};

/// One entry per camera of the rig. Only points of status kOk count.
std::vector<CameraDiagnosis> DiagnoseCameras(const PreparedRig& rig, const std::vector<DiagnosedPoint>& points);

}  // namespace mvstudio::triangulate
