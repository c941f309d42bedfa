#pragma once

#include <vector>

#include "calib/bundle/bundle.h"
#include "calib/bundle/rig_problem.h"

namespace mvstudio::calib {

/// A solution with the terms that its lens models omit added at zero, so that their uncertainty is counted.
struct WithOmitted {
  RigState state;         ///< the lenses' parameters are those of the given state, then zeros
  BundleOptions options;  ///< with a prior on the added terms
};

/// Adds, for the lenses of `chosen` cameras, whose models were chosen for their simplicity, the omitted terms with a prior
/// of mean zero. Standard deviations: decentring 6e-4, k1 and k2 0.1 (68 % of the 520 calibrated cameras of CMU's Panoptic
/// Studio have at most about that), k3 0.06. No radial term may displace the image's corner by more than 1 % (k1 3 %).
/// Unchanged are lenses of five and more terms, wide ones with decentring, and splined ones. `sigma_px` is that of a
/// corner of weight 1.
WithOmitted AddOmittedTerms(const RigState& state, const BundleOptions& options, const std::vector<bool>& chosen, double sigma_px);

/// Columns of the omitted terms, ascending; a shared lens has them once.
std::vector<Eigen::Index> OmittedColumns(const RigColumns& columns, const BundleOptions& options);

/// Shift of all unknowns if the omitted terms were free within their prior. With t ~ N(m, V) by prior and boards, the
/// second moment of the estimate's error is that of the richer lens plus (shift)(shift)^T, shift = B m. `inverse` (n, k):
/// the columns `omitted` of the inverse of the normal equations; `gradient` (n): the gradient at the solution without the
/// terms.
Eigen::VectorXd OmittedShift(const Eigen::MatrixXd& inverse, const std::vector<Eigen::Index>& omitted, const Eigen::VectorXd& gradient);

}  // namespace mvstudio::calib
