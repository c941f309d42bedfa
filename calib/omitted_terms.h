#pragma once

#include <vector>

#include "calib/bundle.h"

namespace mvstudio::calib {

/// A solution whose lenses have the terms that their models leave out, at zero: what the boards could not tell is still uncertain.
struct WithOmitted {
  RigState state;         ///< the lenses' parameters are those of the given state, then zeros
  BundleOptions options;  ///< with what is known of the added terms as a prior
};

/// For the lenses of `chosen` cameras, whose models were chosen for their simplicity: decentring is known to 6e-4 and k2 to 0.1
/// (standard deviations; about what 68 % of the 520 calibrated cameras of CMU's Panoptic Studio have at most). Lenses of four terms
/// with decentring and more, and splined ones, stay. `sigma_px` is that of a corner of weight 1. Covariances at the result are those of
/// "consider parameters" (Schmidt, 1966) as far as the prior holds, and those of the richer lens where the boards know better.
WithOmitted AddOmittedTerms(const RigState& state, const BundleOptions& options, const std::vector<bool>& chosen, double sigma_px);

}  // namespace mvstudio::calib
