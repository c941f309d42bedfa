#pragma once

#include "geometry/lens/models/brown.h"
#include "geometry/lens/models/pinhole.h"

namespace mvstudio::geometry::internal {

/// Brown's lens with k1 (see brown.h).
struct Brown1 : Brown<Brown1, 1> {
  static constexpr std::string_view kName = "brown1";
  using Simpler = Pinhole;
};

}  // namespace mvstudio::geometry::internal
