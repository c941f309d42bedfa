#pragma once

#include <array>
#include <cstdint>

#include "calib/points/point_bundle.h"

namespace mvstudio::calib {

/// Longest side of the box that holds the middle nine tenths of the free points along each axis; metres.
double SceneSide(const PointScene& scene, const std::vector<PointObservation>& observations, const PointBundleOptions& options);

/// Index of a cube in a grid of side `cell`.
using Cube = std::array<int64_t, 3>;
Cube CubeOf(const Eigen::Vector3d& x, double cell);

/// Correction for correlated errors of neighbouring features, which share their patch's perspective, light and shadow. The
/// factor multiplies the variances of cameras and lenses from CovarianceOfPointBundle, which treats all observations as
/// independent.
///
/// The cluster-robust ("sandwich") covariance H^-1 (sum_g s_g s_g^T) H^-1 (Liang and Zeger, "Longitudinal data analysis
/// using generalized linear models", Biometrika 1986) is compared with H^-1. H are the normal equations with the points
/// eliminated, and s_g is the contribution of the points of cluster g to their right-hand side.
///
/// For a camera whose pose has the covariance C in H^-1, the factor is the trace of C^-1 times its block. It is divided by
/// the same trace for independent errors, sum_g H^-1 H_g H^-1 - H^-1 H_g H^-1 H_g H^-1 (after Bell and McCaffrey, "Bias
/// reduction in standard errors", Survey Methodology 2002).
///
/// Clusters are cubes of the space of the free points, from half of its side to a sixteenth, where that makes at least 40.
/// The largest factor of any camera counts. Observations of fixed points stay independent.
struct ClusterInflation {
  double factor = 1;     ///< of the variances, at least 1; 1 when there are too few clusters
  int num_clusters = 0;  ///< that gave it
};

/// At a solution of SolvePointBundle whose weights are 1 / sigma^2 times `sigma_px`^2.
ClusterInflation InflationByClusters(const PointScene& scene, const std::vector<PointObservation>& observations,
                                     const PointBundleOptions& options, double sigma_px);

}  // namespace mvstudio::calib
