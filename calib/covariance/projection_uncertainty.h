#pragma once

#include <Eigen/Core>
#include <memory>
#include <string>
#include <vector>

#include "calib/bundle/bundle.h"
#include "calib/bundle/view.h"
#include "calib/covariance/held_covariance.h"
#include "core/status.h"

namespace mvstudio::calib {

/// Effect of corner noise on a projected pixel.
struct PixelUncertainty {
  Status status = Status::kOk;  ///< kOutsideValidRadius …: the lens has no ray there; kTooFewViews: no corners
  Eigen::Matrix2d covariance_px2 = Eigen::Matrix2d::Zero();
  /// Standard deviation along the worst direction; NaN when the status is not kOk.
  double worst_px() const;
};

/// Effect of corner noise on a point triangulated from noise-free pixels.
struct PointUncertainty {
  Status status = Status::kOk;  ///< kTooFewViews, kLowParallax, kDegenerate: the cameras are not linked by shared boards
  Eigen::Matrix3d covariance_m2 = Eigen::Matrix3d::Zero();  // in world
  double worst_m() const;
};

/// The figures of one camera, px, standard deviations along the worst direction at the median distance of its boards.
struct CameraUncertainty {
  std::string name;
  double range_m = 0;    ///< median distance of its corners
  double centre_px = 0;  ///< at the middle of the image
  double edge_px = 0;    ///< the largest of four: 95 % of the way from the middle to the middle of each side
  double corner_px = 0;  ///< the largest of four: 95 % of the way from the middle to each corner of the image
};

template <class Visitor>
void VisitFields(Visitor&& visit, const CameraUncertainty& r) {
  visit("name", r.name);
  visit("range_m", r.range_m);
  visit("centre_px", r.centre_px);
  visit("edge_px", r.edge_px);
  visit("corner_px", r.corner_px);
}

/// The largest figures over all cameras; NaN where none has a value (lenses that have no ray there are left out).
struct UncertaintySummary {
  double centre_px = 0, edge_px = 0, corner_px = 0;  ///< as in CameraUncertainty
  double volume_mm = 0;      ///< median over the places where boards were seen; see VolumeUncertainty. NaN with one camera
  double volume_max_mm = 0;  ///< the worst of them
  std::vector<CameraUncertainty> cameras;
};

/// Without the cameras.
template <class Visitor>
void VisitFields(Visitor&& visit, const UncertaintySummary& r) {
  visit("centre_px", r.centre_px);
  visit("edge_px", r.edge_px);
  visit("volume_mm", r.volume_mm);
  visit("corner_px", r.corner_px);
  visit("volume_max_mm", r.volume_max_mm);
}

/// Scatter of projections and triangulated points caused by the noise of the calibration's corners. Errors are relative to
/// the boards, not to the gauge. A point keeps its coordinates in each board's frame and moves with the board in every
/// frame; the mean of these positions is projected ("mean frames"; Kogan, mrcal, "Projection uncertainty", 2022). A common
/// motion of everything thus has no effect.
///
/// The mean excludes frames whose corners do not determine the board, and frames that shared boards do not link to the
/// camera. Only corner noise is included: a lens model that does not fit goes unnoticed, so compare with held-out errors.
class ProjectionUncertainty {
 public:
  /// Factorises the normal equations once at `state`, the solution of `options` on `views`. sigma_px is the standard
  /// deviation per coordinate of a corner of weight 1. Errors of unknowns that `options` held are included if `held`
  /// states them. See status().
  ProjectionUncertainty(const std::vector<View>& views, const RigState& state, const BundleOptions& options, double sigma_px,
                        const HeldCovariance& held = {});

  /// kDegenerate when the data leave something undetermined, kBehindCamera when `state` does not project its own corners.
  /// All results then have this status.
  Status status() const;

  /// Uncertainty of the projection of the point seen at `px`, `range_m` metres from the camera along the ray; infinity: a
  /// direction.
  PixelUncertainty PixelCovariance(int camera_idx, const Eigen::Vector2d& px, double range_m) const;

  /// Worst-direction standard deviations, px, (rows, cols) at the nodes of a grid over the image; its outermost lines are
  /// the outermost pixels. NaN where the lens has no ray. At least 2 x 2.
  Eigen::MatrixXd UncertaintyMap(int camera_idx, int cols, int rows, double range_m) const;

  /// Uncertainty of the point triangulated by `cameras` (empty: all whose image contains it) by least squares of their
  /// pixel errors.
  PointUncertainty PointCovariance(const Eigen::Vector3d& x_in_world, std::vector<int> cameras = {}) const;

  /// Worst-direction standard deviations, metres, ascending, at up to `max_points` board positions whose pixels lie in two
  /// or more images. The positions are the boards' middle and outermost corners, evenly over the frames.
  std::vector<double> VolumeUncertainty(int max_points = 200) const;

  UncertaintySummary Summarize() const;

 private:
  struct Prepared;
  std::shared_ptr<const Prepared> prepared_;
};

}  // namespace mvstudio::calib
