#pragma once

#include <optional>
#include <vector>

namespace mvstudio::calib {

/// What a richer model gains: the sum of `differences` (squared errors of independent parts of the data in standard deviations,
/// simpler model minus richer) beyond `cost`, what its further numbers cost (Schwarz, "Estimating the dimension of a model",
/// 1978: the logarithm of the number of points for each). Nothing where that is not positive, or where the sum is not
/// `standard_errors` of itself: then it comes from a few parts alone.
std::optional<double> GainBeyondCost(const std::vector<double>& differences, double cost, double standard_errors);

}  // namespace mvstudio::calib
