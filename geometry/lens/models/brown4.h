#pragma once

#include "geometry/lens/models/brown.h"
#include "geometry/lens/models/brown2.h"

namespace mvstudio::geometry::internal {

/// Brown's lens with k1, k2, p1, p2 (see brown.h).
struct Brown4 : Brown<Brown4, 4> {
  static constexpr std::string_view kName = "brown4";
  using Simpler = Brown2;
};

}  // namespace mvstudio::geometry::internal
