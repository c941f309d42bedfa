#pragma once

#include <string>
#include <vector>

#include "core/status.h"
#include "geometry/rigid/rigid3.h"

namespace mvstudio::calib {

/// Two poses at one time step from devices that share no view: `a_from_p` of body p in a, `b_from_q` of body q in b.
struct HandEyePair {
  geometry::Rigid3 a_from_p, b_from_q;
};

struct HandEyeOptions {
  double max_rotation_sigma_rad = 0.05;  ///< of a_from_b; beyond it the motion counts as degenerate
  double max_translation_sigma = 0.1;    ///< of a_from_b, relative to the median distance of the bodies
  double min_axis_spread_rad = 0.005;    ///< RMS rotation about the second strongest axis below which it is considered absent
  double min_axis_spread_noise = 3;      ///< the same in units of the rotation noise, which looks like a rotation itself
};

struct HandEye {
  /// kTooFewViews below 3 pairs; kDegenerate when the motion is about one axis or too small for the noise; kNonFiniteInput.
  Status status = Status::kOk;
  std::string message;  ///< one line when the status is not kOk: what is missing
  geometry::Rigid3 a_from_b, q_from_p;
  geometry::Vector6d a_from_b_sigma = geometry::Vector6d::Zero();  ///< standard deviations of a left perturbation
  double rotation_rms_rad = 0, translation_rms_m = 0;              ///< disagreement of the pairs that count
  int num_inliers = 0;
};

/// a_from_b and q_from_p, both constant, such that a_from_p = a_from_b * b_from_q * q_from_p for all pairs (AX = YB; the
/// motions between pairs give AX = XB).
///
/// Closed form for samples of three pairs and for all of them (Park, Martin, "Robot sensor calibration: solving AX=XB on
/// the Euclidean group", IEEE Trans. Robotics and Automation 1994). The candidate with the smallest median error is
/// refined over all pairs by robust least squares. Rotation and translation errors are each in units of their own noise.
/// Deterministic.
HandEye SolveHandEye(const std::vector<HandEyePair>& pairs, const HandEyeOptions& options = {});

}  // namespace mvstudio::calib
