#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "calib/board/observations.h"
#include "core/units.h"
#include "geometry/rig/rig.h"

/// Detection of cameras that moved while the boards were filmed.
namespace mvstudio::calib {

/// A camera that changed while the boards were filmed (FindMotions).
struct CameraMotion {
  /// kLens: focus, zoom, crop or scale changed, which explains more than a motion. kDrift: steady motion from last_before
  /// to frame_idx.
  enum class Kind { kMoved, kLens, kDrift };
  Kind kind = Kind::kMoved;
  std::vector<std::string> cameras;  ///< the one that moved; several when the data cannot tell which
  int64_t frame_idx = 0;             ///< the first frame after the motion in which the camera and another see a board
  int64_t last_before = 0;           ///< the last such frame before it
  double rotation_rad = 0, rotation_sigma_rad = 0;
  double translation_m = 0;                                   ///< of cam_from_world
  double focal_scale = 1, focal_scale_sigma = 0;              ///< kLens: focal length after it over that before
  Eigen::Vector2d centre_shift_px = Eigen::Vector2d::Zero();  ///< kLens: shift of the principal point
  double shift_px = 0;                                        ///< rms shift of the camera's corners by the motion
  double significance = 0;  ///< of the change, in standard deviations over the root of its 6 parameters
};

inline std::string ToString(CameraMotion::Kind kind) {
  using Kind = CameraMotion::Kind;
  return kind == Kind::kLens ? "lens" : kind == Kind::kDrift ? "drift" : "moved";
}

template <class Visitor>
void VisitFields(Visitor&& visit, const CameraMotion& r) {
  visit("kind", r.kind);
  visit("cameras", r.cameras);
  visit("last_frame_before", r.last_before);
  visit("first_frame_after", r.frame_idx);
  visit("rotation_deg", RadToDeg(r.rotation_rad));
  visit("rotation_sigma_deg", RadToDeg(r.rotation_sigma_rad));
  visit("translation_mm", 1e3 * r.translation_m);
  visit("focal_scale", r.focal_scale);
  visit("focal_scale_sigma", r.focal_scale_sigma);
  visit("centre_shift_px", r.centre_shift_px);
  visit("shift_px", r.shift_px);
  visit("significance", r.significance);
}

/// Finds cameras that moved, in the order of detection. The recording is cut into up to 12 time intervals. Each camera
/// gets a pose per interval, with lenses and other cameras fixed and boards free. The motion is at the cut where the poses
/// before and after differ most relative to their own scatter.
///
/// The camera whose motion explains most comes first; its observations then no longer count when the others are tested
/// again. `rig` is the calibration from the same corners. Ignored are motions below 5 standard deviations, or with an
/// image shift below the larger of 0.3 px and one standard deviation of the camera's corners, and what the residuals of `rig`
/// as it is do not show (ShowsInResiduals). `input`: corners that need no correction (calib/check/seen_corners.h).
std::vector<CameraMotion> FindMotions(const geometry::Rig& rig, const CalibrateInput& input);

}  // namespace mvstudio::calib
