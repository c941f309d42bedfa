#pragma once

#include "geometry/lens/models/brown.h"
#include "geometry/lens/models/brown4.h"

namespace mvstudio::geometry::internal {

/// Brown's lens with k1, k2, p1, p2, k3 and the denominator's k4, k5, k6 (see brown.h).
struct Rational8 : Brown<Rational8, 8> {
  static constexpr std::string_view kName = "rational8";
  using Simpler = Brown4;
};

}  // namespace mvstudio::geometry::internal
