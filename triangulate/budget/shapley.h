#pragma once

#include <vector>

namespace mvstudio::triangulate {

/// Shares of `n` stages in the error that the truth in place of all of them removes (Shapley, "A value for n-person games",
/// 1953). `error_of` has 2^n entries: entry s is the error with the truth in place of stage i wherever bit i of s is set. A
/// stage's share is what its truth removes, averaged over all orders in which the stages can be mended. The shares sum to
/// error_of.front() - error_of.back(), exactly but for rounding.
std::vector<double> ShapleyShares(const std::vector<double>& error_of);

}  // namespace mvstudio::triangulate
