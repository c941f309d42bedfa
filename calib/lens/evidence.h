#pragma once

#include <optional>
#include <vector>

#include "calib/lens/intrinsics.h"

namespace mvstudio::calib {

/// Gain of a richer model: the sum of `differences` minus `cost`. The differences are squared errors of independent parts
/// of the data in standard deviations, simpler model minus richer. The cost is that of the additional parameters, each the
/// logarithm of the number of points (Schwarz, "Estimating the dimension of a model", 1978). Empty if it is not positive,
/// or if the sum is less than `standard_errors` of its own standard errors and so comes from a few parts alone.
std::optional<double> GainBeyondCost(const std::vector<double>& differences, double cost, double standard_errors);

/// Evidence of the boards on a camera's focal length: the smallest increase of the sum of squares, in units of the
/// variance (roughly chi-squared with one degree of freedom), when the focal lengths are halved or doubled. The distortion
/// is rescaled so that boards parallel to the image look the same, and the boards' poses are fitted again.
///
/// Hundreds of thousands for ordinary footage; a few dozen at most when all boards are parallel to the image, where noise
/// makes a covariance look finite although the focal length is unknown. Empty for wide models, which have no such scaling,
/// and for failed solutions.
std::optional<double> FocalEvidence(const MonoSolution& solution);

/// Evidence below which the focal length counts as undetermined.
inline constexpr double kMinFocalEvidence = 100;

}  // namespace mvstudio::calib
