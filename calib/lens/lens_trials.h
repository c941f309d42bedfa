#pragma once

#include <vector>

#include "calib/lens/model_selection.h"

/// Which lenses are fitted and held out. Only those that can win are: held-out errors cost several adjustments each.
namespace mvstudio::calib {

/// The pool under `config`, without held-out errors: they are empty, the status is that of the fit.
LensCandidate FitCandidate(const LensPool& pool, const LensConfig& config, const BundleOptions& bundle);

void HoldOut(const SelectionOptions& options, const BundleOptions& bundle, LensCandidate* candidate);

/// All configurations fitted, those held out that can win, in the order of `configs`; ones without a solution are left out.
/// First is held out the lens that the boards call for (Schwarz's criterion). Others are not where their residuals on the very
/// boards of the fit exceed its errors on held-out boards, or where more parameters than it has explain less than one corner
/// coordinate's noise each, or less than they cost and a percent of the error. Only where these leave residuals that are smooth
/// over the boards are two kinds fitted: wide lenses of one or two parameters, if Kannala and Brandt's was tried, and lenses with
/// a grid, finer ones where the coarser one explained more.
std::vector<LensCandidate> TryLenses(const LensPool& pool, const std::vector<LensConfig>& configs,
                                     const SelectionOptions& options, const BundleOptions& bundle, const RunContext& run);

}  // namespace mvstudio::calib
