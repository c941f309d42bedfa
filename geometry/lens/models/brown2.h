#pragma once

#include "geometry/lens/models/brown.h"
#include "geometry/lens/models/brown1.h"

namespace mvstudio::geometry::internal {

/// Brown's lens with k1, k2 (see brown.h).
struct Brown2 : Brown<Brown2, 2> {
  static constexpr std::string_view kName = "brown2";
  using Simpler = Brown1;
};

}  // namespace mvstudio::geometry::internal
