#include "dataset/panoptic/panoptic_units.h"

#include <cstdio>
#include <cstdlib>

namespace mvstudio::dataset::internal {

Eigen::Vector3d OursFromPanopticCm(double x, double y, double z) { return {x / 100.0, z / 100.0, -y / 100.0}; }

double Centimetres(double metres) {
  char text[32];
  for (int digits = 9; digits <= 17; ++digits) {
    std::snprintf(text, sizeof(text), "%.*g", digits, metres * 100.0);
    const double cm = std::strtod(text, nullptr);
    if (cm / 100.0 == metres) return cm;
  }
  return metres * 100.0;
}

}  // namespace mvstudio::dataset::internal
