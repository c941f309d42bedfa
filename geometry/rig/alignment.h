#pragma once

#include <Eigen/Core>

#include "core/status.h"
#include "geometry/rig/rig.h"
#include "geometry/rigid/rigid3.h"

namespace mvstudio::geometry {

struct Alignment {
  Status status = Status::kOk;  ///< kTooFewViews below 3 points, kDegenerate when they are collinear
  Rigid3 b_from_a;
  double scale = 1;  ///< x_in_b ~ scale * R x_in_a + t; 1 unless asked for
  double rms = 0;    ///< metres, after alignment
};

/// Least-squares transform from points (3, N) in a to points in b. Umeyama, "Least-squares estimation of transformation
/// parameters between two point patterns", PAMI 1991.
Alignment AlignPoints(const Eigen::Matrix3Xd& x_in_a, const Eigen::Matrix3Xd& x_in_b, bool with_scale = false);

struct RigDifference {
  Status status = Status::kOk;
  double max_rotation_rad = 0, mean_rotation_rad = 0;    ///< of each camera, after alignment
  double max_translation_m = 0, mean_translation_m = 0;  ///< of each camera centre, after alignment
  double max_focal_relative = 0;                         ///< |f - f_ref| / f_ref over fx and fy
  double max_lens_px =
      0;  ///< distance of the two pixels that one ray in cam has through both lenses, over the reference's image
  Rigid3 reference_from_rig;
};

/// Compares two rigs with the same camera names after the rigid motion that best aligns their camera centres and axes (no
/// scale).
RigDifference CompareRigs(const Rig& rig, const Rig& reference);

}  // namespace mvstudio::geometry
