#include "stages/nets/avatar_fit_image.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "avatar/body/texture/surface_image.h"
#include "core/check.h"
#include "core/statistics.h"

namespace mvstudio::stages {
namespace {

constexpr int kHeightPx = 480;
constexpr double kSigmaLimitM = 0.01, kLimitStepM = 0.005;

/// 98 % of the offsets lie below it, in whole steps.
double OffsetLimit(const Eigen::VectorXd& offsets) {
  const Eigen::VectorXd sizes = offsets.cwiseAbs();
  const double most = LinearQuantile(std::vector<double>(sizes.begin(), sizes.end()), 0.98);
  return kLimitStepM * std::max(1.0, std::ceil(most / kLimitStepM));
}

Image SideBySide(const Image& left, const Image& right) {
  Image both(left.width + right.width, left.height, 3);
  for (int y = 0; y < both.height; ++y) {
    std::copy_n(left.Pixel(0, y), 3 * left.width, both.Pixel(0, y));
    std::copy_n(right.Pixel(0, y), 3 * right.width, both.Pixel(left.width, y));
  }
  return both;
}

}  // namespace

SurfaceMaps MapSurface(const body::TexturedPerson& person) {
  MVS_CHECK(person.offset_m.size() > 0 && person.offset_m.size() == person.offset_sigma_m.size(), "no offsets to be shown");
  const double limit = OffsetLimit(person.offset_m);
  Eigen::VectorXd known = person.offset_m;
  for (Eigen::Index v = 0; v < known.size(); ++v) {
    if (!(person.offset_sigma_m[v] < kSigmaLimitM)) known[v] = std::numeric_limits<double>::quiet_NaN();
  }
  const body::BodyTemplate& body = person.person.body;
  return {SideBySide(body::SurfaceImage(body, known, {-limit, limit}, kHeightPx),
                     body::SurfaceImage(body, person.offset_sigma_m, {0, kSigmaLimitM}, kHeightPx)),
          1e3 * limit, 1e3 * kSigmaLimitM};
}

}  // namespace mvstudio::stages
