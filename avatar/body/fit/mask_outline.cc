#include "avatar/body/fit/mask_outline.h"

#include <cmath>
#include <limits>
#include <utility>

#include "core/check.h"
#include "core/units.h"

namespace mvstudio::body {

using Eigen::Vector2d;

MaskOutline::MaskOutline(Image mask) : mask_(std::move(mask)) {
  MVS_CHECK(mask_.channels == 1, "a mask of " << mask_.channels << " channels");
}

double MaskOutline::At(const Vector2d& px) const {
  const double x = px[0], y = px[1];
  if (!(x >= 0 && y >= 0 && x <= mask_.width - 1 && y <= mask_.height - 1)) return std::numeric_limits<double>::quiet_NaN();
  const int x0 = std::min(static_cast<int>(x), mask_.width - 2), y0 = std::min(static_cast<int>(y), mask_.height - 2);
  if (x0 < 0 || y0 < 0) return std::numeric_limits<double>::quiet_NaN();
  const double fx = x - x0, fy = y - y0;
  const uint8_t *a = mask_.Pixel(x0, y0), *b = mask_.Pixel(x0, y0 + 1);
  return ((1 - fy) * ((1 - fx) * a[0] + fx * a[1]) + fy * ((1 - fx) * b[0] + fx * b[1])) / 255;
}

bool MaskOutline::Faces(const Vector2d& px, const Vector2d& outward) const {
  constexpr double kReach = 2, kCosine = 0.5;
  constexpr int kDirections = 16;
  Vector2d falls(0,
                 0);  // a binary mask falls within a pixel: where it lies on a circle says more than differences along the axes
  for (int k = 0; k < kDirections; ++k) {
    const double angle = 2 * kPi * k / kDirections;
    const Vector2d direction(std::cos(angle), std::sin(angle));
    falls -= At(px + kReach * direction) * direction;
  }
  return falls.dot(outward) > kCosine * falls.norm();
}

double MaskOutline::Crossing(const Vector2d& px, const Vector2d& outward, double inner, double outer) const {
  for (int k = 0; k < 6; ++k) {
    const double middle = (inner + outer) / 2;
    (At(px + middle * outward) >= 0.5 ? inner : outer) = middle;
  }
  return (inner + outer) / 2;
}

std::optional<double> MaskOutline::Distance(const Vector2d& px, const Vector2d& outward, double max_px) const {
  const double here = At(px);
  if (!std::isfinite(here)) return std::nullopt;
  const bool inside = here >= 0.5;
  const double direction = inside ? 1 : -1;
  for (double distance = 1; distance <= max_px; distance += 1) {
    const double next = At(px + direction * distance * outward);
    if (!std::isfinite(next)) return std::nullopt;
    if ((next >= 0.5) != inside) {
      const double at = inside ? Crossing(px, outward, distance - 1, distance) : Crossing(px, outward, -distance, 1 - distance);
      if (!Faces(px + at * outward, outward)) return std::nullopt;
      return at;
    }
  }
  return std::nullopt;
}

}  // namespace mvstudio::body
