#pragma once

#include <optional>
#include <string>

#include "calib/board/observations.h"

namespace mvstudio::calib {

/// Two cameras with one and the same footage.
struct SameCorners {
  std::string a, b;
  int num_same = 0, num_views = 0;  ///< views that are equal, of those of the camera that has fewer
};

/// Cameras whose views are equal to the last digit in half of the cases or more, three at least, whatever the frames are
/// called: two sensors never see the same noise. Empty: none.
std::optional<SameCorners> FindSameCorners(const CalibrateInput& input);

/// One line.
std::string ToString(const SameCorners& same);

}  // namespace mvstudio::calib
