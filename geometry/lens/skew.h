#pragma once

#include <Eigen/Geometry>

#include "geometry/lens/camera.h"

namespace mvstudio::geometry {

/// A camera whose matrix has no skew in place of one that has: half of the skew is a turn about the optical axis, which the
/// pose takes; the other half is lost.
struct WithoutSkew {
  Camera camera;
  Eigen::Quaterniond turn = Eigen::Quaterniond::Identity();  ///< cam_from_(the camera with skew)
  double worst_px = 0;                                       ///< largest distance over the image
};

/// `camera` with K = [fx skew cx; 0 fy cy; 0 0 1], for lenses whose terms are radial, decentring or thin prism in OpenCV's
/// order, and kannala4. K acts behind the distortion, so the error is linear and largest at a corner.
WithoutSkew ReplaceSkew(const Camera& camera, double skew_px);

}  // namespace mvstudio::geometry
