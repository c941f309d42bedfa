#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "core/status.h"
#include "geometry/lens/camera.h"
#include "geometry/rigid/rigid3.h"

namespace mvstudio::calib {

/// Cameras and the points that they see.
struct PointScene {
  std::vector<geometry::Camera> lenses;
  std::vector<int> lens_of_camera;               // per camera: index into lenses, which may be shared
  std::vector<geometry::Rigid3> cam_from_world;  // per camera
  Eigen::Matrix3Xd points;                       // (3, N) in world, metres where the scale is known

  const geometry::Camera& LensOf(int camera_idx) const {
    return lenses[static_cast<size_t>(lens_of_camera[static_cast<size_t>(camera_idx)])];
  }
};

struct PointObservation {
  int camera_idx = 0;
  int point_idx = 0;
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  double weight = 1;  ///< of the squared residual, 1/px^2 for a standard deviation of 1 px; 0: rejected
};

/// Known distance between the centres of two cameras.
struct KnownDistance {
  int a = 0, b = 0;
  double distance = 0, sigma = 0;  ///< in the unit of the scene; the sigma is at least 1e-6 of the distance
};

/// Maximum number of directions of one lens.
inline constexpr int kMaxLensDirections = 32;

struct PointBundleOptions {
  std::vector<Eigen::MatrixXd>
      lens_directions;                      ///< per lens (P, K): the directions in which its parameters may move; empty: none
  std::vector<bool> fix_camera, fix_point;  ///< empty: none
  std::optional<KnownDistance> distance;
  bool reject_outliers = true;
  double reject_sigmas = 4.5;  ///< an observation farther than this many standard deviations per coordinate is rejected
  double min_sigma = 0;        ///< lower bound on the residuals' sigma; 1 if weights are true inverse variances
  double robust_px = 0;        ///< scale of a Cauchy loss in the first adjustment; 0: from the residuals of the start
  double cost_tolerance = 1e-10;
  int max_iterations = 200;
  int num_threads = 1;
};

struct PointBundleReport {
  Status status = Status::kOk;      ///< kTooFewViews, kNonFiniteInput, kNotConverged, kUndefined
  std::string message;              ///< one line when the status is not kOk
  double start_cost = 0, cost = 0;  ///< weighted sums of squared residuals
  double rms_px = 0;                ///< 2-D point RMS over the observations that were kept
  double sigma_px = 0;  ///< standard deviation per coordinate of an observation of weight 1, corrected for the degrees of
                        ///< freedom
  int num_observations = 0, num_rejected = 0, num_iterations = 0;
};

/// Directions for PointBundleOptions. FixedLens: none. FocalDirections: the focal length (ratio of fx and fy fixed) and
/// the first `num_distortion` distortion parameters. AllDirections: all parameters.
Eigen::MatrixXd FixedLens(const geometry::Camera& lens);
Eigen::MatrixXd FocalDirections(const geometry::Camera& lens, int num_distortion = 0);
Eigen::MatrixXd AllDirections(const geometry::Camera& lens);

/// Bundle adjustment of cameras and points: weighted least squares of the reprojection errors over the free lens
/// directions, cam_from_world (left perturbation) and points. The larger of the two groups, cameras or points, is
/// eliminated (SolveSchurLm).
///
/// With reject_outliers, a Cauchy loss first, then plain squares without observations that are too far or cannot be
/// projected. Points that keep fewer than 2 observations lose all. Unfixed gauge freedoms (frame, scale) stay near their
/// start. Triggs et al., "Bundle adjustment - a modern synthesis", 1999.
PointBundleReport SolvePointBundle(PointScene* scene, std::vector<PointObservation>* observations,
                                   const PointBundleOptions& options);

struct PointBundleCovariance {
  Status status = Status::kOk;  ///< kDegenerate: some unknown is not determined, see `message`
  std::string message;
  std::vector<Eigen::MatrixXd> lens;                        ///< per lens (P, P), zero in fixed directions
  std::vector<Eigen::Matrix<double, 6, 6>> cam_from_world;  ///< per camera, left perturbation; zero for fixed ones
  Eigen::MatrixXd joint;  ///< of all cameras, as geometry::Rig::joint_covariance; cameras of one lens share its errors
};

/// Covariances at a solution, times sigma_px^2: the inverse of the normal equations with the points eliminated. Frame and
/// scale must be fixed by fixed points, or by a fixed camera and a known distance.
///
/// `held_lens`, per lens: the covariance (P, P) of a lens of up to kMaxLensDirections parameters that `options` hold
/// fixed; it propagates to the poses. Empty, or empty for a lens: exact.
PointBundleCovariance CovarianceOfPointBundle(const PointScene& scene, const std::vector<PointObservation>& observations,
                                              const PointBundleOptions& options, double sigma_px,
                                              const std::vector<std::optional<Eigen::MatrixXd>>& held_lens = {});

/// Residuals (2, number of observations) px, projected minus observed; infinite where a point does not project.
Eigen::Matrix2Xd PointResiduals(const PointScene& scene, const std::vector<PointObservation>& observations);

}  // namespace mvstudio::calib
