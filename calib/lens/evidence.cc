#include "calib/lens/evidence.h"

#include <cmath>

namespace mvstudio::calib {

std::optional<double> GainBeyondCost(const std::vector<double>& differences, double cost, double standard_errors) {
  double gain = 0, squares = 0;
  for (const double difference : differences) gain += difference, squares += difference * difference;
  if (!(gain > cost) || !(gain > standard_errors * std::sqrt(squares))) return std::nullopt;
  return gain - cost;
}

}  // namespace mvstudio::calib
