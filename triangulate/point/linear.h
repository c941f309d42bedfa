#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/status.h"
#include "triangulate/point/prepared_rig.h"

/// Closed-form solutions on undistorted rays. All coordinates are `local` (see PreparedRig).
namespace mvstudio::triangulate {

struct LinearPoint {
  /// kTooFewViews; kDegenerate when the rays do not determine a point (parallel, or one centre); of the solvers for two views
  /// also kBehindCamera.
  Status status = Status::kOk;
  Eigen::Vector3d x_in_local = Eigen::Vector3d::Zero();
};

/// The point with the least sum of squared distances from the rays (as infinite lines).
LinearPoint Midpoint(const std::vector<View>& views);

/// Inhomogeneous least squares with each ray weighted by one over its distance and angular noise, from one reweighting of
/// the midpoint. Near the maximum-likelihood point (Hartley and Sturm, "Triangulation", CVIU 1997, Iterative-LS, one
/// round).
LinearPoint WeightedLinear(const std::vector<View>& views);

/// Largest sine of the angle between two rays over its own standard deviation: below about 5 the depth is mostly noise.
/// Angles of 0 and of 180 degrees are equivalent.
double ParallaxSignificance(const std::vector<View>& views);
double ParallaxSignificance(const View& a, const View& b);

}  // namespace mvstudio::triangulate
