#pragma once

#include <string>
#include <vector>

#include "calib/bundle/bundle.h"
#include "calib/bundle/view.h"
#include "calib/lens/intrinsics.h"
#include "core/status.h"

namespace mvstudio::calib {

/// Model assumptions about the lenses of several cameras and their boards.
struct LensConfig {
  geometry::LensModel model = geometry::LensModel::kBrown4;
  geometry::SplineGrid spline;  ///< kSplined only
  bool shared = false;          ///< one lens for all cameras
  bool warp = false;            ///< boards may be warped
  bool stretch = false;         ///< boards may be stretched
};

/// "brown4", "splined 16x11", "brown2, shared".
std::string ToString(const LensConfig& config);
/// Total number of lens parameters of `num_cameras` cameras.
int NumLensParams(const LensConfig& config, int num_cameras);

/// Views of several cameras, each with its own board pose: lenses are compared here, before the cameras are combined.
struct LensPool {
  Status status = Status::kOk;
  std::string message;
  LensConfig config;
  RigState state;                      ///< cameras at the origin; one frame per view
  std::vector<View> views;             ///< View::frame is the position in this list
  std::vector<Eigen::VectorXd> prior;  ///< initial weights, before any rejection
  std::vector<int> cluster;            ///< per view, as from ClusterViews; the views of one cluster are not independent
  BundleReport bundle;
};

/// The views of cameras that were calibrated separately; `cameras` are indices into `monos` and become 0, 1, … `boards` is
/// the number of boards.
LensPool MakePool(const std::vector<MonoSolution>& monos, const std::vector<int>& cameras, int boards);

/// The options of an adjustment of a pool: every board has a pose of its own.
BundleOptions PoolBundle(const LensConfig& config, const BundleOptions& options);

/// Adjusts all lenses (and warps) of the pool under another configuration.
LensPool FitPool(const LensPool& start, const LensConfig& config, const BundleOptions& options);

/// Errors on boards that took no part in the estimation.
struct PoolHoldout {
  Status status = Status::kOk;                      ///< kTooFewViews when no camera has 3 clusters of views
  std::vector<std::vector<double>> view_errors_px;  ///< per view of the pool; only corners that carry information on the lens
};

/// K-fold cross-validation over the clusters of views: lenses from the other folds, errors as from AppendHeldOutErrors.
/// Corners that a solution rejected count too. At most `max_views` views per camera, evenly spaced, are held out and have
/// errors; the others are trained on, unless one of the same cluster is held out.
PoolHoldout HoldoutErrors(const LensPool& fit, int num_folds, int max_views, const BundleOptions& options);

/// The same errors with the lenses of the fit, which the boards took part in: less than held out, at no cost.
std::vector<std::vector<double>> ErrorsOnOwnBoards(const LensPool& fit);

inline constexpr double kGrossPx = 5;  ///< held-out corners beyond this are gross errors

struct HoldoutSummary {
  double rms_px = 0;          ///< over corners within kGrossPx, 2-D
  double median_px = 0;       ///< over all corners
  double gross_fraction = 0;  ///< of all corners
  int num_corners = 0;
};
/// NaN without corners. `camera_idx` of the pool, or -1 for all.
HoldoutSummary Summarize(const LensPool& pool, const PoolHoldout& holdout, int camera_idx);

}  // namespace mvstudio::calib
