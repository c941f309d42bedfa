#pragma once

#include <Eigen/Core>
#include <limits>
#include <vector>

#include "core/status.h"
#include "geometry/lens/camera.h"
#include "geometry/rigid/rigid3.h"

/// Difference in px between the projections of one point by two calibrations of a camera: what matters in use, whatever
/// the parameters are. After mrcal's `mrcal-show-projection-diff`: http://mrcal.secretsauce.net/differencing.html
namespace mvstudio::calib {

struct ProjectionDiffOptions {
  std::vector<double> ranges_m = {1, 3, std::numeric_limits<double>::infinity()};  ///< distances of the points, metres
  /// Fit the rigid motion between the two camera frames that explains most of the difference. Calibrations from boards
  /// leave the camera's own frame slightly free, and the poses of the rig compensate for it. If false, the frames are
  /// taken as equal.
  bool implied = true;
  double focus = 1;    ///< share of the image's half diagonal, around its centre, in which the motion is fitted
  int grid_cols = 24;  ///< points across the image; same density vertically
};

struct ProjectionDiffAtRange {
  double range_m = 0;
  double rms_px = 0, max_px = 0, centre_px = 0;
  int num_points = 0;                ///< points that both lenses see; the others are NaN in the grid
  Eigen::MatrixXd grid_px;           // (rows, cols) length of the difference
  Eigen::MatrixXd grid_dx, grid_dy;  // (rows, cols) pixel by the camera minus pixel by the reference
};

struct ProjectionDiff {
  Status status = Status::kOk;  ///< kDegenerate when the image sizes differ, kTooFewViews when the lenses share no point
  geometry::Rigid3 cam_from_reference;  ///< implied motion; identity without
  double rotation_rad = 0, translation_m = 0;
  Eigen::Matrix2Xd grid_axes_px;  // (2, max(rows, cols)): u of the columns, v of the rows, NaN beyond
  std::vector<ProjectionDiffAtRange> ranges;
};

/// Over a grid of pixels of `reference`: pixel -> ray -> point at the range -> implied motion -> pixel through `camera`.
ProjectionDiff CompareProjection(const geometry::Camera& camera, const geometry::Camera& reference,
                                 const ProjectionDiffOptions& options = {});

}  // namespace mvstudio::calib
