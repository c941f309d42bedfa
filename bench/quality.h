#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/stopwatch.h"

namespace mvstudio::bench {

/// One line of the accuracy/speed table: the same problems, one method.
struct Row {
  std::string problem, method;
  std::string unit;  ///< of the errors
  double median_error = 0, max_error = 0;
  double refused = 0;  ///< share of problems answered with a status instead of a value
  double us_per_item = 0;
};

/// Median, maximum and refusals of `errors` (NaN: refused).
Row MakeRow(const std::string& problem, const std::string& method, const std::string& unit, std::vector<double> errors,
            double seconds);

std::vector<Row> BenchLens(uint64_t seed);
std::vector<Row> BenchTriangulation(uint64_t seed);

}  // namespace mvstudio::bench
