#pragma once

#include <limits>
#include <string>
#include <vector>

#include "calib/board/observations.h"
#include "calib/check/verdict.h"
#include "calib/rig/board_metrics.h"
#include "core/progress.h"
#include "core/status.h"
#include "geometry/rig/rig.h"

/// Is an existing calibration still true? New footage of a board answers: has a camera been bumped, which one, how far.
namespace mvstudio::calib {

struct RigCheckOptions {
  double reject_sigmas = 4.5;  ///< corners farther from their own view's fit than this are dropped
  double bump_sigmas = 3;  ///< a camera has moved when its motion, over 6 numbers, exceeds this many standard deviations …
  double bump_px = 0.5;    ///< … and moves its corners in the image by this much (rms)
  double scale_percent =
      0.2;  ///< a calibration whose lengths are off by more than this is checked with boards of its own scale
  double warn_px = 1, fail_px = 3;  ///< limits of a camera's rms against the boards that all cameras agree on
};

template <class Visitor>
void VisitFields(Visitor&& visit, RigCheckOptions& o) {
  visit("reject-sigmas", o.reject_sigmas,
        "corners farther from the fit to their own view than so many standard deviations are dropped");
  visit("bump-sigmas", o.bump_sigmas,
        "a camera has moved when its motion exceeds so many standard deviations and option 'bump-px'");
  visit("bump-px", o.bump_px, "shift of its corners in the image (rms) below which a camera's motion is let pass");
  visit("scale-percent", o.scale_percent,
        "error of all lengths beyond which the verdict is warn and cameras are checked apart from it");
  visit("warn-px", o.warn_px, "rms of a camera above which the verdict is warn");
  visit("fail-px", o.fail_px, "rms of a camera above which the verdict is fail");
}

/// One camera against the others.
struct CameraCheck {
  std::string name;
  int num_views = 0;  ///< boards that another camera saw at the same instant
  int num_corners = 0;
  int num_rejected = 0;              ///< corners that do not fit their own view
  int num_bad_views = 0;             ///< boards without a pose, or far worse than the camera's others
  double own_rms_px = 0;             ///< every view with a pose of its own: lens and detection alone
  int num_outlying_views = 0;        ///< boards beyond 4 times the median of the camera's others: not in the figures below
  double rms_px = 0, median_px = 0;  ///< as calibrated, boards placed by the cameras that have not moved
  double rms_after_px = 0;           ///< the same with the pose below
  Status status = Status::kOk;       ///< of the pose; kTooFewViews when no board is shared with another camera
  geometry::Rigid3 cam_from_world;   ///< estimated anew with all others held
  double rotation_rad = 0, rotation_sigma_rad = 0;    ///< against the calibration; sigma along that motion
  double translation_m = 0, translation_sigma_m = 0;  ///< of the camera's centre
  double shift_px = 0;                                ///< rms shift of its corners by that motion
  double significance = 0;                            ///< sqrt(d^T C^-1 d / 6) of the motion d: about 1 when nothing moved
  bool moved = false;
};

struct RigCheck {
  Status status = Status::kOk;  ///< kTooFewViews when no two cameras see a board at one instant
  std::string message;
  std::vector<CameraCheck> cameras;    ///< those of the rig that are in the input, in the rig's order
  std::vector<std::string> moved;      ///< cameras found to have moved
  std::vector<std::string> undecided;  ///< one of these (or of their lenses) has changed, it cannot be told which
  double rms_px = 0, median_px = 0;    ///< over the cameras that have not moved
  double scale = 1;                    ///< lengths by the calibration over lengths on the board
  BoardMetrics board_metrics;          ///< board lengths triangulated with the calibration as it is
  int num_boards = 0;                  ///< boards that two cameras or more saw at one instant
  /// The rig with the moved cameras' new poses. Their covariances hold what comes from the cameras that they were placed by, as far
  /// as the rig states it; a rig that states nothing gets none.
  geometry::Rig repaired;
  Verdict verdict;
};

/// Boards are placed by all cameras jointly with weights that fall with a view's error (Cauchy), so that a camera that
/// disagrees does not drag them along. Then each camera in turn is set free; the one whose freedom explains most is the one
/// that moved, if that is significant and no other explains nearly as much (80 %); it stays free and the search goes on. With
/// two cameras, or where only two share boards, the answer is `undecided`. With three or more, an error of scale is told apart:
/// the boards then take the calibration's scale. The noise comes from fits of every view by itself; standard deviations are
/// widened by what frames disagree among each other. The calibration's own uncertainty is not in them. Throws UsageError when a
/// camera of the input is not in the rig or its image size differs.
RigCheck CheckRig(const geometry::Rig& rig, const CalibrateInput& input, const RigCheckOptions& options, const RunContext& run);

}  // namespace mvstudio::calib
