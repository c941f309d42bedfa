#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "calib/bundle/bundle.h"
#include "calib/bundle/rig_problem.h"
#include "geometry/rig/rig.h"
#include "geometry/rig/rig_covariance.h"

/// Propagates errors of unknowns that an adjustment holds fixed to those that it estimates.
namespace mvstudio::calib {

/// Joint covariance of estimated (x) and held (y) unknowns, in the order of `normal` (n, n): the normal equations over
/// both, with all other unknowns eliminated. With x = argmin given the held y, dx/dy = -H_xx^-1 H_xy = A, so cov(x) = own
/// + A S A^T and cov(x, y) = A S ("consider covariance"; Schmidt, "Application of state-space methods to navigation
/// problems", 1966). `inverse` is H_xx^-1, `own` the covariance of x for exact y, `held_covariance` is S. Data and S are
/// independent.
Eigen::MatrixXd CovarianceWithHeld(const Eigen::MatrixXd& normal, const std::vector<Eigen::Index>& estimated,
                                   const std::vector<Eigen::Index>& held, const Eigen::MatrixXd& inverse,
                                   const Eigen::MatrixXd& own, const Eigen::MatrixXd& held_covariance);

/// Lenses and poses that BundleOptions hold at the values of a given calibration that states their covariance.
struct HeldCovariance {
  geometry::StatedCovariance stated;  ///< in the order of the state's cameras
  std::vector<bool> lens, pose;       ///< per camera: held, and its covariance is known
  bool any() const;
};

/// `start` may lack cameras and covariances. A lens whose model differs from the state's counts as unknown.
HeldCovariance HeldCovarianceOf(const std::optional<geometry::Rig>& start, const RigState& state, const BundleOptions& options);

/// The problem of an adjustment with the held unknowns freed, and which ones were held.
struct FreedProblem {
  BundleOptions options;
  RigState state;  ///< held lenses are removed from their groups
  RigColumns columns;
  std::vector<Eigen::Index> estimated, held;  ///< columns, each ascending
  Eigen::MatrixXd covariance;                 ///< of the held ones
};

FreedProblem FreeHeld(const std::vector<View>& views, const RigState& state, const BundleOptions& options,
                      const HeldCovariance& held);

}  // namespace mvstudio::calib
