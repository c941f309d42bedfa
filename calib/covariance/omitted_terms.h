#pragma once

#include <vector>

#include "calib/bundle/bundle.h"
#include "calib/bundle/rig_problem.h"

namespace mvstudio::calib {

/// A solution whose lenses have the terms that their models leave out, at zero: what the boards could not tell is still uncertain.
struct WithOmitted {
  RigState state;         ///< the lenses' parameters are those of the given state, then zeros
  BundleOptions options;  ///< with what is known of the added terms as a prior
};

/// For the lenses of `chosen` cameras, whose models were chosen for their simplicity: what is known of the terms that they omit,
/// standard deviations: decentring 6e-4, k1 and k2 0.1 (about what 68 % of the 520 calibrated cameras of CMU's Panoptic Studio have at
/// most), k3 0.06, and no radial term more than displaces the image's corner by 1 % (k1 3 %). Lenses of five terms and more, wide ones
/// with decentring, and splined ones, stay. `sigma_px` is that of a corner of weight 1.
WithOmitted AddOmittedTerms(const RigState& state, const BundleOptions& options, const std::vector<bool>& chosen, double sigma_px);

/// Columns of the omitted terms, ascending; lenses that are shared have theirs once.
std::vector<Eigen::Index> OmittedColumns(const RigColumns& columns, const BundleOptions& options);

/// What the boards would move all unknowns by, if the omitted terms were free within their prior: with t ~ N(m, V) by prior and boards,
/// the second moment of the estimate's error is that of the richer lens plus (shift)(shift)^T, shift = B m. `inverse` (n, k): the
/// columns `omitted` of the inverse of the normal equations, `gradient` (n) theirs at the lean solution.
Eigen::VectorXd OmittedShift(const Eigen::MatrixXd& inverse, const std::vector<Eigen::Index>& omitted, const Eigen::VectorXd& gradient);

}  // namespace mvstudio::calib
