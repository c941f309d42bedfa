#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "core/status.h"
#include "geometry/rig/rig.h"

namespace mvstudio::calib {

/// Image position of a point with known world coordinates.
struct PointClick {
  int camera_idx = 0;
  int point_idx = 0;
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
};

struct PointResectionOptions {
  double click_sigma_px = 1;  ///< expected standard deviation of a click per coordinate; raise it for blurred marks
  bool refine_lens = false;   ///< also focal length and k1, if leave-one-out errors show that it pays
};

template <class Visitor>
void VisitFields(Visitor&& visit, PointResectionOptions& o) {
  visit("click-sigma-px", o.click_sigma_px, "px; expected standard deviation of a marked point, per coordinate");
  visit("refine-lens", o.refine_lens, "also refine focal length and k1 where left-out points show that it pays");
}

struct PointResection {
  Status status = Status::kOk;  ///< kTooFewViews below 4 points, kDegenerate, kNotConverged
  std::string message;          ///< one line when the status is not kOk
  geometry::Rigid3 rig_from_world;
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();  ///< of rig_from_world, left perturbation
  std::vector<geometry::Camera> cameras;                                         ///< as given, or with a refined lens
  std::vector<std::optional<Eigen::MatrixXd>> params_covariance;                 ///< per camera, of refined lenses
  /// The same including the errors of the given lenses and poses. Unknowns: the six of rig_from_world, then each camera's
  /// lens directions. Given: for each camera its lens parameters and the six of cam_from_rig.
  Eigen::MatrixXd unknowns_covariance;           ///< (X, X) for exact lenses and poses
  Eigen::MatrixXd unknowns_by_given;             ///< (X, N) derivatives
  std::vector<Eigen::MatrixXd> lens_directions;  ///< per camera (P, K): params = given + directions * unknowns
  std::string lens_reason;                       ///< why the lens was refined or not; empty unless asked for
  Eigen::Matrix2Xd residuals_px;                 ///< (2, clicks) projected minus clicked; infinite where it does not project
  std::vector<bool> rejected;                    ///< per click: a gross error
  double rms_px = 0;                             ///< 2-D point RMS over the kept clicks
  double sigma_px = 0;                           ///< per coordinate: estimated, but for few clicks not below the expected one
  double leave_one_out_px = 0;                   ///< 2-D RMS of each kept click when it is left out; NaN for fewer than 5
  int num_used = 0;
};

/// Pose of a rigid group of cameras (or of one) in the frame of points with known coordinates. `rig` holds intrinsics and,
/// as cam_from_world, the poses cam_from_rig of the group; a single camera has the identity.
///
/// Initial pose: minimal solutions from triples of clicks (OpenGV: Kneip et al., CVPR 2011 for one camera; generalised
/// P3P, Kneip, Furgale, Siegwart, ICRA 2013 for several). All triples are tried when there are few. The one with the least
/// median error is taken (Rousseeuw, 1984), so it tolerates gross errors in fewer than half of the clicks. Then least
/// squares over the kept clicks, with the covariance.
///
/// Refuses collinear points, and poses that the clicks leave uncertain by more than a quarter of the distance.
PointResection ResectFromPoints(const std::vector<geometry::RigCamera>& rig, const std::vector<PointClick>& clicks,
                                const Eigen::Matrix3Xd& x_in_world, const PointResectionOptions& options = {});

}  // namespace mvstudio::calib
