#pragma once

#include <cmath>
#include <string>

#include "geometry/rig/alignment.h"

/// A synthetic session beside its truth.
namespace mvstudio::stages {

struct StudioComparison {
  geometry::RigDifference rig;
  double joints_median_mm = NAN, joints_mean_mm = NAN, predicted_sigma_median_mm = NAN;
  double coverage68 = NAN, coverage95 = NAN;  ///< share of joints inside the predicted error ellipsoids
  int num_joints = 0;
};

/// Joints are brought into the truth's world by the alignment of the two rigs alone, never by one fitted to the joints
/// (docs/decisions/0003). `points`: folder of the take's 3D joints. Throws IoError, FormatError.
StudioComparison CompareStudio(const std::string& session, const std::string& calibration, const std::string& points);

}  // namespace mvstudio::stages
