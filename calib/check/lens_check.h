#pragma once

#include <vector>

#include "calib/bundle/view.h"
#include "core/status.h"
#include "geometry/lens/camera.h"

namespace mvstudio::calib {

/// One camera's lens by itself: boards at any pose, as where no other camera sees them.
struct LensCheck {
  Status status = Status::kOk;  ///< of the lens that was fitted anew; kTooFewViews below kFewestViews
  int num_views = 0, num_corners = 0;
  double rms_px = 0;           ///< with the lens as it is
  double refitted_rms_px = 0;  ///< with its numbers free, in the same model
  double focal_px = 0, refitted_focal_px = 0;
  double significance = 0;  ///< square root of the gain per parameter, in standard deviations: about 1 for a lens that holds
  double shift_px = 0;      ///< what a distant point moves by in the image, rms, when the camera may turn to hide it
  bool changed = false;     ///< significant, visible in the residuals, and of an effect

  static constexpr int kFewestViews = 5;
};

template <class Visitor>
void VisitFields(Visitor&& visit, const LensCheck& r) {
  visit("status", r.status);
  visit("changed", r.changed);
  visit("num_boards", r.num_views);
  visit("rms_px", r.rms_px);
  visit("refitted_rms_px", r.refitted_rms_px);
  visit("focal_px", r.focal_px);
  visit("refitted_focal_px", r.refitted_focal_px);
  visit("shift_px", r.shift_px);
  visit("significance", r.significance);
}

/// `views`: of one camera, weights 0 for corners that do not count. Changed are lenses whose gain exceeds `sigmas` standard
/// deviations a parameter and 2 % of what is left, and that move points by `least_px`.
LensCheck CheckLens(const geometry::Camera& camera, std::vector<View> views, double sigmas, double least_px);

}  // namespace mvstudio::calib
