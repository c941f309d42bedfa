#pragma once

#include <vector>

#include "calib/bundle/view.h"

/// Errors that the corners of one board have in common: the print, a sheet that bends with the hand, light, blur.
namespace mvstudio::calib {

/// Variance of each camera's lens over that of independent corners, 1 or more, by how the boards in different places draw the
/// lens apart. `cluster_of_view` as from ClusterViews; each cluster is one unit.
///
/// The units' gradients g_k of the lens, their boards' poses eliminated, would have the covariance s^2 (H_k - H_k H^-1 H_k)
/// with independent corners (H the sum of the information H_k, s^2 the mean square of the residuals). The ratio is that of the
/// traces of sum g_k g_k^T and of its expectation, in units of H: the estimate by units (Liang and Zeger, "Longitudinal data
/// analysis using generalized linear models", 1986) with the leverage of few units as by Bell and McCaffrey, "Bias reduction in
/// standard errors for linear regression with multi-stage samples", 2002. It is 1 unless it exceeds 1 by 2.5 standard
/// deviations. Cameras of one lens have one ratio. Splined lenses, held lenses (`fixed`) and fewer than three units have 1.
std::vector<double> VarianceByBoards(const std::vector<View>& views, const std::vector<int>& cluster_of_view,
                                     const RigState& state, const std::vector<bool>& fixed = {});

/// The weights divided by the cameras' ratios.
void DiscountByBoards(const std::vector<double>& ratio, std::vector<View>* views);

}  // namespace mvstudio::calib
