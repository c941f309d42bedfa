#pragma once

#include <optional>
#include <vector>

namespace mvstudio::calib {

/// Gain of a richer model: the sum of `differences` minus `cost`. The differences are squared errors of independent parts
/// of the data in standard deviations, simpler model minus richer. The cost is that of the additional parameters, each the
/// logarithm of the number of points (Schwarz, "Estimating the dimension of a model", 1978). Empty if it is not positive,
/// or if the sum is less than `standard_errors` of its own standard errors and so comes from a few parts alone.
std::optional<double> GainBeyondCost(const std::vector<double>& differences, double cost, double standard_errors);

}  // namespace mvstudio::calib
