#pragma once

#include <cstdint>
#include <vector>

#include "triangulate/prepared_rig.h"
#include "triangulate/types.h"

namespace mvstudio::triangulate {

enum class PointMethod {
  kRobust,    ///< linear start, consistent set of views, maximum-likelihood refinement
  kAllViews,  ///< linear start and refinement with every view, outliers included
  kLinear,    ///< weighted inhomogeneous least squares with every view
  kMidpoint,  ///< point nearest to all rays
};

/// All thresholds are in units of the noise, none in metres or pixels (but the caller's own limit of distance).
struct PointOptions {
  PointMethod method = PointMethod::kRobust;
  double max_residual_sigmas = 4;  ///< a view whose residual is larger does not carry the point
  double min_parallax_sigmas = 5;  ///< the sine of the parallax, and the distance, must exceed so many of their own sigmas
  double max_distance_m = 0;       ///< 0: no limit; else kFarPoint beyond it from the nearest camera
  int min_views = 2;
  double min_inlier_fraction = 0.3;  ///< of the views; below it the point is kOutlier
  int max_hypotheses = 500;          ///< pairs of views tried; all pairs where there are fewer
  uint64_t seed = 1;                 ///< for the choice of pairs where there are more
};

/// Triangulates one point from one observation a camera.
///
/// Robust selection: when the fit to all views leaves a residual above the limit, the largest set of views that agrees with its
/// own maximum-likelihood point is looked for; over all subsets for up to 6 views, from pairs with local optimisation (Lebeda
/// et al., BMVC 2012) for more. The set is always re-evaluated at the refined point. Two views that agree by chance carry no
/// point when another pair agrees as well somewhere else (kOutlier).
///
/// Status: kNonFiniteInput, kOutsideValidRadius, kTooFewViews (observations that cannot be used leave too few); kDegenerate
/// (one centre, or the point lies at a camera's centre); kLowParallax (depth not determined against the noise, rays parallel or
/// antiparallel); kBehindCamera; kOutlier (no set of views agrees); kFarPoint; kNotConverged.
Point TriangulatePoint(const PreparedRig& rig, const std::vector<Observation>& observations, const PointOptions& options = {});

}  // namespace mvstudio::triangulate
