#pragma once

#include <optional>
#include <string>

#include "calib/bundle/bundle.h"
#include "geometry/lens/camera.h"

/// Lenses in order of decreasing complexity: where the boards do not determine a lens, the next simpler one is tried.
namespace mvstudio::calib {

struct LensStep {
  geometry::LensModel model = geometry::LensModel::kPinhole;
  geometry::SplineGrid spline;
  bool assume_centre = false;  ///< the principal point lies near the image's centre
  bool assume_focal = false;   ///< also, the focal length is about that of a camera with a usual field of view
};

/// The next lens with fewer parameters. Decentring is removed first, then the higher terms. After the simplest model, the
/// principal point is assumed, and last the focal length. Empty after that. A splined lens gets a coarser grid, then
/// kannala4.
std::optional<LensStep> NextSimpler(const LensStep& step);

/// The assumptions of a step as a prior for BundleOptions; empty vectors without any. `sigma_px` is the standard deviation
/// of a corner of weight 1. The principal point has a standard deviation of 2 % of the image's diagonal. The focal length
/// is 0.9 of the image's longer side within 50 %; for wide lenses, that of `camera` within 50 %.
LensPrior PriorOf(const LensStep& step, const geometry::Camera& camera, double sigma_px);

/// "pinhole", "pinhole, its principal point assumed at the image's centre +- 26 px".
std::string ToString(const LensStep& step, const geometry::Camera& camera);

}  // namespace mvstudio::calib
