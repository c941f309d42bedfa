#pragma once

#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "triangulate/point/prepared_rig.h"
#include "triangulate/point/types.h"

namespace mvstudio::triangulate {

/// Methods that compute one point from its views; solvers.h describes the closed forms. All but kRobust use every view,
/// outliers included, unless PointOptions::select_views is set.
enum class PointMethod {
  kRobust,        ///< "robust", "auto": linear start, consistent set of views, maximum-likelihood refinement
  kAllViews,      ///< "all-views": linear start and maximum-likelihood refinement with every view
  kLinear,        ///< "linear": weighted inhomogeneous least squares on the rays
  kMidpoint,      ///< "midpoint": point nearest to all rays
  kDlt,           ///< "dlt": homogeneous direct linear transformation
  kLeastSquares,  ///< "least-squares": inhomogeneous least squares
  kLost,          ///< "lost": linear optimal sine triangulation
  kMid2,          ///< "mid2": Lee and Civera's midpoint, of the two views of largest parallax
  kWmid2,         ///< "wmid2": the same weighted by inverse depth
  kL1,            ///< "l1": least sum of two angles
  kLinf,          ///< "linf": least maximum of two angles
};

inline constexpr PointMethod kAllPointMethods[] = {PointMethod::kRobust,   PointMethod::kAllViews,     PointMethod::kLinear,
                                                   PointMethod::kMidpoint, PointMethod::kDlt,          PointMethod::kLost,
                                                   PointMethod::kMid2,     PointMethod::kLeastSquares, PointMethod::kWmid2,
                                                   PointMethod::kL1,       PointMethod::kLinf};

/// "robust", "all-views", … as above.
std::string_view ToString(PointMethod method);
/// Also knows "auto".
std::optional<PointMethod> PointMethodFromString(std::string_view name);

/// All thresholds are in units of the noise, none in metres or pixels (except the caller's own limit of distance).
struct PointOptions {
  PointMethod method = PointMethod::kRobust;
  double max_residual_sigmas = 4;  ///< a view with a larger residual is not used for the point
  double min_parallax_sigmas = 5;  ///< the sine of the parallax, and the distance, must exceed this many of their own sigmas
  double max_distance_m = 0;       ///< 0: no limit; else kFarPoint beyond this distance from the nearest camera
  int min_views = 2;
  double min_inlier_fraction = 0.3;  ///< of the views; below it the point is kOutlier
  int max_hypotheses = 500;          ///< pairs of views tried; all pairs where there are fewer
  uint64_t seed = 1;                 ///< for the choice of pairs where there are more
  bool select_views = false;         ///< choose views as kRobust does, with any method
};

/// Triangulates one point from one observation per camera.
///
/// Robust selection: when the fit to all views leaves a residual above the limit, the largest set of views that agrees
/// with its own point is searched, see FitConsistent in robust.h. The set is always re-evaluated at the refined point. Two
/// views that agree by chance give no point when another pair agrees as well elsewhere, nor does a set of views beside an
/// equally large one with another point (kOutlier).
///
/// An observation that repeats another camera's pixel exactly, where both cameras have one pose and one lens, is the same
/// image under two names. It is left out, so that the covariance does not count it twice.
///
/// Status: kNonFiniteInput, kOutsideValidRadius, kTooFewViews (unusable observations leave too few); kDegenerate (one
/// centre, or the point lies at a camera's centre); kLowParallax (depth not determined against the noise, rays parallel or
/// antiparallel); kBehindCamera; kOutlier (no set of views agrees); kFarPoint; kNotConverged.
Point TriangulatePoint(const PreparedRig& rig, const std::vector<Observation>& observations, const PointOptions& options = {});

}  // namespace mvstudio::triangulate
