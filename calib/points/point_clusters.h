#pragma once

#include <array>
#include <cstdint>

#include "calib/points/point_bundle.h"

namespace mvstudio::calib {

/// Longest side of the box that holds the middle nine tenths of the free points each way; metres.
double SceneSide(const PointScene& scene, const std::vector<PointObservation>& observations, const PointBundleOptions& options);

/// Place in a grid of cubes of side `cell`.
using Cube = std::array<int64_t, 3>;
Cube CubeOf(const Eigen::Vector3d& x, double cell);

/// Neighbouring features of pictures do not err independently: they share their patch's perspective, light and shadow. This is
/// how many times larger the variances of cameras and lenses are for it than CovarianceOfPointBundle, which takes every
/// observation for an independent one, says.
///
/// The cluster-robust ("sandwich") covariance H^-1 (sum_g s_g s_g^T) H^-1 (Liang and Zeger, "Longitudinal data analysis using
/// generalized linear models", Biometrika 1986) is compared with H^-1, where H are the normal equations with the points
/// eliminated and s_g what the points of cluster g contribute to their right-hand side. For a camera whose pose has the
/// covariance C in H^-1 the factor is the trace of C^-1 times its block, over the same trace of what independent errors give,
/// sum_g H^-1 H_g H^-1 - H^-1 H_g H^-1 H_g H^-1 (after Bell and McCaffrey, "Bias reduction in standard errors", Survey
/// Methodology 2002). Clusters are cubes of the space that the free points fill, from half of its side to a sixteenth, where
/// that makes at least 40; the largest factor of any camera counts. Observations of fixed points stay independent.
struct ClusterInflation {
  double factor = 1;     ///< of the variances, at least 1; 1 when there are too few clusters to tell
  int num_clusters = 0;  ///< that gave it
};

/// At a solution of SolvePointBundle whose weights are 1 / sigma^2 times `sigma_px`^2.
ClusterInflation InflationByClusters(const PointScene& scene, const std::vector<PointObservation>& observations,
                                     const PointBundleOptions& options, double sigma_px);

}  // namespace mvstudio::calib
