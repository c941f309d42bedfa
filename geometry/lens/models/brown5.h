#pragma once

#include "geometry/lens/models/brown.h"
#include "geometry/lens/models/brown4.h"

namespace mvstudio::geometry::internal {

/// Brown's lens with k1, k2, p1, p2, k3 (see brown.h): what OpenCV calibrates by default.
struct Brown5 : Brown<Brown5, 5> {
  static constexpr std::string_view kName = "brown5";
  using Simpler = Brown4;
};

}  // namespace mvstudio::geometry::internal
