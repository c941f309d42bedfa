#pragma once

#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "calib/board/observations.h"
#include "calib/check/lens_check.h"
#include "calib/check/seen_corners.h"
#include "calib/check/verdict.h"
#include "calib/rig/board_metrics.h"
#include "core/progress.h"
#include "core/status.h"
#include "geometry/rig/rig.h"

/// Tests whether an existing calibration still holds, with new footage of a board: which camera has moved, and how far.
namespace mvstudio::calib {

struct RigCheckOptions {
  double reject_sigmas = 4.5;  ///< corners farther than this many standard deviations from the fit to their own view are
                               ///< dropped
  double bump_sigmas = 3;  ///< a camera has moved when its motion, over 6 parameters, exceeds this many standard deviations …
  double bump_px = 0.5;    ///< … and moves its corners in the image by this much (rms)
  double scale_percent =
      0.2;  ///< a calibration whose lengths are off by more than this is checked with boards of its own scale
  double warn_px = 1, fail_px = 3;  ///< limits of a camera's rms, with boards placed by all cameras
};

template <class Visitor>
void VisitFields(Visitor&& visit, RigCheckOptions& o) {
  visit("reject-sigmas", o.reject_sigmas, "standard deviations from the fit to its own view beyond which a corner is dropped");
  visit("bump-sigmas", o.bump_sigmas,
        "a camera has moved when its motion exceeds this many standard deviations and option 'bump-px'");
  visit("bump-px", o.bump_px, "px; shift of its corners in the image (rms) below which a camera's motion is accepted");
  visit("scale-percent", o.scale_percent,
        "error of all lengths beyond which the verdict is warn and cameras are checked apart from it; beyond ten times as much "
        "it is "
        "fail");
  visit("warn-px", o.warn_px, "rms of a camera above which the verdict is warn");
  visit("fail-px", o.fail_px, "rms of a camera above which the verdict is fail");
}

/// One camera against the others.
struct CameraCheck {
  std::string name;
  int num_views = 0;  ///< boards that another camera saw at the same time step
  int num_corners = 0;
  int num_rejected = 0;              ///< corners that do not fit their own view
  int num_bad_views = 0;             ///< boards without a pose, or much worse than the camera's other boards
  double own_rms_px = 0;             ///< rms with a free pose per view: lens and detection errors alone
  std::optional<LensCheck> lens;     ///< of a camera that shares no board with another
  int num_outlying_views = 0;        ///< boards beyond 4 times the median of the camera's others: excluded from the figures
                                     ///< below
  double rms_px = 0, median_px = 0;  ///< as calibrated, boards placed by the cameras that have not moved
  double rms_after_px = 0;           ///< the same with the pose below
  Status status = Status::kOk;       ///< of the pose; kTooFewViews when no board is shared with another camera
  geometry::Rigid3 cam_from_world;   ///< re-estimated with all other cameras fixed
  double rotation_rad = 0, rotation_sigma_rad = 0;    ///< against the calibration; sigma along that motion
  double translation_m = 0, translation_sigma_m = 0;  ///< of the camera's centre
  double shift_px = 0;                                ///< rms shift of its corners in the image by that motion
  double significance = 0;                            ///< sqrt(d^T C^-1 d / 6) of the motion d: about 1 when nothing moved
  bool is_visible = false;                            ///< the residuals as they are show that motion (ShowsInResiduals)
  bool moved = false;
};

/// Without the lens.
template <class Visitor>
void VisitFields(Visitor&& visit, const CameraCheck& r) {
  visit("name", r.name);
  visit("status", r.status);
  visit("moved", r.moved);
  visit("num_views", r.num_views);
  visit("num_corners", r.num_corners);
  visit("num_rejected", r.num_rejected);
  visit("num_bad_views", r.num_bad_views);
  visit("num_outlying_views", r.num_outlying_views);
  visit("own_rms_px", r.own_rms_px);
  visit("rms_px", r.rms_px);
  visit("median_px", r.median_px);
}

/// A camera whose images agree with the others' at other times than the calibration states.
struct LateCamera {
  std::string camera;
  double frames = 0;  ///< its capture time minus that of the frame
};

struct RigCheck {
  Status status = Status::kOk;  ///< kTooFewViews when no two cameras see a board at one time step, and more than one is there
  std::string message;
  std::vector<CameraCheck> cameras;    ///< those of the rig that are in the input, in the rig's order
  std::vector<std::string> moved;      ///< cameras found to have moved
  std::vector<std::string> undecided;  ///< one of these cameras (or their lenses) has changed; the data cannot tell which
  double rms_px = 0, median_px = 0;    ///< over the cameras that have not moved
  double scale = 1;          ///< lengths by the calibration over lengths on the board; NaN where no two cameras see one well
  bool two_cameras = false;  ///< only two are there, which know of each other alone
  std::vector<std::string> exchanged;  ///< the two cameras whose corners are each other's
  BoardMetrics board_metrics;          ///< board lengths triangulated with the calibration as it is
  int num_boards = 0;                  ///< boards that two or more cameras saw at one time step
  CornerFindings found;                ///< what was corrected in the corners
  bool offsets_stated = false;         ///< the calibration states time offsets of these cameras …
  bool offsets_used = false;           ///< … and the corners agree better with them than without
  std::vector<LateCamera> late;        ///< found where the corners disagree, and nothing has moved with these offsets
  double cost = 0;                     ///< robust, per corner, of the calibration as it is
  /// The rig with the new poses of the moved cameras. Their covariances include the contribution of the cameras that they
  /// were placed by, as far as the rig states it; without stated covariances there are none.
  geometry::Rig repaired;
  Verdict verdict;
};

/// Boards are placed by all cameras jointly, with Cauchy weights per view, so that a camera that disagrees has little
/// influence. Then each camera in turn is freed. The one whose freedom reduces the cost most has moved, if this is
/// significant and no other reduces it nearly as much (80 %). It stays free and the search continues.
///
/// With two cameras, or where only two share boards, the answer is `undecided`, or a scale where boards of another size explain
/// all. With three or more, a scale error is
/// separated: the boards then take the calibration's scale.
///
/// The noise comes from fits to single views. Standard deviations are widened by the disagreement between frames, but do
/// not include the calibration's own uncertainty. A motion counts only where the residuals of the calibration as it is show it,
/// and new poses are taken only if they leave less of all corners unexplained than the old ones.
///
/// Where a camera seems to have moved, cameras whose names were exchanged are tried first: of equal size, half of the cost,
/// no motion left. Then parts of a frame by which cameras are late are tried instead: a file of another format
/// does not state them, and cameras that are started anew have others. They count where no motion is left with them, and a
/// third less of the cost.
///
/// The corners are corrected first by what is found about them (SeenCorners), and by the time offsets that the calibration
/// states where they agree better with them than without. Throws UsageError as SeenCorners does, and when cameras of the input
/// are not in the rig and fewer than two are.
RigCheck CheckRig(const geometry::Rig& rig, const CalibrateInput& input, const RigCheckOptions& options, const RunContext& run);

}  // namespace mvstudio::calib
