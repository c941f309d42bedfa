#pragma once

#include <optional>
#include <string>

#include "calib/bundle/bundle.h"
#include "geometry/lens/camera.h"

/// Lenses by falling demand on the boards: where these do not determine a lens, the next simpler one is tried.
namespace mvstudio::calib {

struct LensStep {
  geometry::LensModel model = geometry::LensModel::kPinhole;
  geometry::SplineGrid spline;
  bool assume_centre = false;  ///< the principal point lies near the image's centre
  bool assume_focal = false;   ///< besides, the focal length is about that of a camera with a usual field of view
};

/// The lens with fewer numbers: decentring goes first, then the higher terms; after the simplest model, what is assumed of the
/// principal point, and last of the focal length. Nothing after that. A splined lens gets a coarser grid, then kannala4.
std::optional<LensStep> NextSimpler(const LensStep& step);

/// The assumptions of a step as a prior for BundleOptions; empty vectors without any. `sigma_px` is the standard deviation of a
/// corner of weight 1. The centre is assumed to within 2 % of the image's diagonal (standard deviation), the focal length to be
/// 0.9 of the image's longer side within 50 %, for wide lenses that of `camera` within 50 %.
LensPrior PriorOf(const LensStep& step, const geometry::Camera& camera, double sigma_px);

/// "pinhole", "pinhole, its principal point assumed at the image's centre +- 26 px".
std::string ToString(const LensStep& step, const geometry::Camera& camera);

}  // namespace mvstudio::calib
