#pragma once

#include "geometry/lens/models/brown.h"
#include "geometry/lens/models/rational8.h"

namespace mvstudio::geometry::internal {

/// rational8 with s1 … s4, of thin prisms (see brown.h).
struct ThinPrism12 : Brown<ThinPrism12, 12> {
  static constexpr std::string_view kName = "thinprism12";
  using Simpler = Rational8;
};

}  // namespace mvstudio::geometry::internal
