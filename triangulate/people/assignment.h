#pragma once

#include <Eigen/Core>
#include <vector>

namespace mvstudio::triangulate {

/// One-to-one assignment of rows to columns with the largest sum of gains, where a row or column may stay unassigned (gain
/// 0). Returns the column of each row, or -1. Pairs whose gain is not positive (or NaN) are never made. Shortest
/// augmenting paths with potentials, O(n^3): Jonker and Volgenant, "A shortest augmenting path algorithm for dense and
/// sparse linear assignment problems", Computing 1987.
std::vector<int> BestAssignment(const Eigen::MatrixXd& gain);

}  // namespace mvstudio::triangulate
