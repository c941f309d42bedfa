#pragma once

#include <string>

#include "geometry/lens/camera.h"
#include "geometry/rig/plausible.h"

/// What the verdict accepts of a lens where no board was.
namespace mvstudio::calib {

using geometry::kFoldSlack;

/// Limits of a camera's projection uncertainty, px.
struct PixelLimits {
  double side_px = 1;  ///< at the image's sides
  double fail_side_px = 5;
  double corner_px = 10;  ///< in its corners
};

/// `need_px` is what the images are for; 0: 0.2 % of the image's diagonal, at least 1 px. A side fails at 5 px, which grows
/// with the diagonal beyond a full-HD image, or at 1.5 times a larger need; with a given need at 5 times that. Corners, where
/// boards seldom reach and little is filmed: 1 % of the diagonal, at least 10 px, and 5 times a given need.
PixelLimits PixelLimitsOf(const geometry::Camera& camera, double need_px);

/// Where a lens has no ray.
struct FoldedPlaces {
  double share = 0;       ///< of the image
  std::string where;      ///< "the top-left corner and the left side"; empty: nowhere
  double nearest_px = 0;  ///< distance of the nearest such place from the principal point
};
FoldedPlaces FindFolds(const geometry::Camera& camera);

}  // namespace mvstudio::calib
