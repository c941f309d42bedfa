#pragma once

#include "calib/bundle/view.h"
#include "core/status.h"

namespace mvstudio::calib {

struct Resection {
  Status status = Status::kOk;  ///< kTooFewViews below 4 corners, kDegenerate when they are collinear, kNotConverged
  geometry::Rigid3 cam_from_board;
  double rms_px = 0;        ///< 2-D point RMS over the corners with a weight
  double other_rms_px = 0;  ///< of the mirrored orientation of the plane; ambiguous if close to rms_px
};

/// Pose of the board from one view and known intrinsics. A homography in undistorted coordinates, then least squares of
/// the reprojection error from it and from its mirrored orientation, the second one that a plane may have. Returns the
/// better one. Of points off a plane (SpansSpace), from their direct linear transformation.
Resection ResectPlane(const geometry::Camera& camera, const View& view);

/// Least squares of the reprojection error from a start.
Resection RefinePose(const geometry::Camera& camera, const View& view, const geometry::Rigid3& start);

}  // namespace mvstudio::calib
