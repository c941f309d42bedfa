#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "calib/board/layout.h"
#include "calib/board/observations.h"
#include "calib/calibrate_options.h"
#include "calib/check/camera_motion.h"
#include "calib/check/verdict.h"
#include "calib/covariance/projection_uncertainty.h"
#include "calib/lens/lens_limits.h"
#include "calib/rig/bending.h"
#include "calib/rig/board_metrics.h"
#include "calib/rig/frame_drops.h"
#include "calib/rig/frame_rate.h"
#include "calib/rig/free_boards.h"
#include "calib/rig/numbering.h"
#include "calib/rig/readout.h"
#include "core/progress.h"
#include "core/status.h"
#include "geometry/rig/lenses_only.h"
#include "geometry/rig/rig.h"

namespace mvstudio::calib {

/// What `intrinsics_only` gives. As CalibrateInput::start its poses are not used.
using geometry::kLensesOnly;

/// A corner after the adjustment.
struct CornerResidual {
  int camera_idx = 0;
  int64_t frame_idx = 0;
  int corner_id = 0;
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  Eigen::Vector2d residual_px = Eigen::Vector2d::Zero();  ///< projected minus observed
  bool rejected = false;
  int board_idx = 0;
  Eigen::Vector2d late_px = Eigen::Vector2d::Zero();  ///< how the board's motion from the frame's time to the image's moved it
};

struct CameraReport {
  std::string name;
  geometry::LensModel model = geometry::LensModel::kPinhole;
  std::string model_reason;
  std::string given_up;    ///< lenses that the boards did not determine, the simpler ones taken instead, and why; empty: none
  bool lens_held = false;  ///< the lens was given and did not change (CalibrateOptions::fix): no board took part in it
  bool assumes = false;    ///< the principal point, or also the focal length, is assumed (LensStep)
  int num_params = 0, num_views = 0, num_corners = 0, num_rejected = 0;
  int num_places = 0;                                          ///< clusters of views: boards held still count once
  int num_lost_views = 0;                                      ///< boards all of whose corners were rejected
  double sigma_px = std::numeric_limits<double>::quiet_NaN();  ///< standard deviation per coordinate of its corners
  double repeat_correlation = 0;            ///< correlation of a corner's errors in images of a board that did not move: 0 to 1
  double aspect_sigma = 0;                  ///< of log(fx / fy) with the boards' cells free; infinite where it is open, 0 where
                                            ///< nothing makes one ask
  double focal_px = 0, focal_sigma_px = 0;  ///< mean of fx and fy; sigma 0 also where the rig states no covariance of the
                                            ///< lens
  double rms_px = 0;
  double alone_rms_px = 0;                                          ///< the camera calibrated alone
  double smooth_rms_px = std::numeric_limits<double>::quiet_NaN();  ///< of a held lens: the noise of its corners, see
                                                                    ///< SmoothErrorPx
  double holdout_rms_px = 0, holdout_median_px = 0;                 ///< NaN when there are too few views; rms within 5 px
  double rig_holdout_gross_fraction = 0;  ///< its share of CalibrateReport's; NaN without held-out frames
  double holdout_gross_fraction = 0;      ///< of the held-out corners, beyond 5 px
  std::string shares_lens_with;           ///< names, separated by ", "
  double time_offset_frames = 0;          ///< by which its images are late, in the middle of the recording
  double time_rate = 0;                   ///< what that grows by in a frame
  Readout readout;                        ///< rolling shutter
  double outside_fraction = 0;            ///< fraction of its corners outside the stated image size
  double coverage = 0;                    ///< fraction of the cells of a 10 x 8 grid over the image that hold a
                                          ///< corner
  double valid_radius = 0;                ///< of the lens model, see geometry::Projector
  bool points_in_space = false;           ///< held out were single points, which do not lie in a plane, and not whole boards
  bool covers_image = true;               ///< all image corners lie within the valid radius
  FoldedPlaces folds;                     ///< where the lens model has no ray
  std::string lens_beyond;                ///< LensChoice::beyond
};

/// One line of the table of lens models that were compared, for one camera.
struct SelectionRow {
  std::string camera, model;  ///< model as ToString(LensConfig)
  int num_params = 0;         ///< of this camera; shared ones count for every camera
  double holdout_rms_px = 0, holdout_median_px = 0, gross_fraction = 0;
  bool chosen = false;
};

template <class Visitor>
void VisitFields(Visitor&& visit, const SelectionRow& r) {
  visit("camera", r.camera);
  visit("model", r.model);
  visit("num_params", r.num_params);
  visit("holdout_rms_px", r.holdout_rms_px);
  visit("holdout_median_px", r.holdout_median_px);
  visit("gross_fraction", r.gross_fraction);
  visit("chosen", r.chosen);
}

struct CalibrateReport {
  Status status = Status::kOk;
  std::string message;  ///< one line when the status is not kOk
  geometry::Rig rig;    ///< with covariances, when the status allows
  std::vector<int64_t> frames;
  std::vector<geometry::Rigid3> world_from_board;
  std::vector<CameraReport> cameras;
  std::vector<CornerResidual> residuals;
  std::vector<std::vector<int>> components;  ///< groups of cameras linked by shared boards
  std::vector<int> suspects;  ///< without a solution: cameras whose lenses or links are the reason, as far as that is known
  double rms_px = 0, sigma_px = 0;  ///< 2-D RMS over kept corners; standard deviation per coordinate
  double holdout_rms_px = 0, holdout_median_px = 0, holdout_gross_fraction = 0;
  std::vector<SelectionRow> selection;
  std::string warp_reason, stretch_reason, time_reason;
  bool stretch_untried = false;        ///< too few views to tell boards' cells from squares
  std::vector<int64_t> frame_shift;    ///< per camera, added to the frame numbers so that equal numbers are one time step;
                                       ///< empty: none
  std::vector<FrameRate> frame_rates;  ///< per camera, how its frame numbers were changed; empty: not
  std::vector<FrameDrop> frame_drops;  ///< frames that cameras lost, after which they were renumbered
  std::string held_conflict;           ///< the given lens or pose, fixed by `fix`, that the boards contradict; empty: none
  bool free_boards = false;            ///< each of several boards has a place of its own in every time step
  std::vector<BoardMove> board_moves;  ///< with free_boards
  std::string boards_moved;            ///< how boards moved against each other, and what giving each its own place explains;
                                       ///< empty: they did not, or nobody asked
  std::string frames_conflict;  ///< why frames with the same number may not be simultaneous; empty: nothing contradicts it
  std::vector<Eigen::Vector2d> board_warp_m;   ///< per board; zero when it is taken as flat
  std::vector<Eigen::Vector2d> board_stretch;  ///< per board: shear and aspect, see RigState; empty when it is taken as
                                               ///< square
  std::vector<geometry::Rigid3> rig_from_board;
  double board_size_m = 0;     ///< diagonal of the first board's corners
  BoardMetrics board_metrics;  ///< over the frames held out (CalibrateOptions::holdout), else over all
  double rig_holdout_rms_px = 0, rig_holdout_median_px = 0;  ///< on frames held out; NaN without; rms within 5 px
  double rig_holdout_gross_fraction = 0;  ///< fraction of their corners beyond 5 px or on boards that could not be placed;
                                          ///< NaN without
  std::vector<CameraMotion> motions;
  std::string unexplained;    ///< what the likeliest cause would leave, where that is most of the residuals; empty: it explains
                              ///< them, or there is nothing to explain
  double unexplained_px = 0;  ///< shift of the camera's corners by that cause
  std::vector<NumberingFault> numbering;
  std::vector<RotatedCamera>
      rotated;  ///< cameras of which views were numbered from the board's other end, see FindRotatedViews
  std::optional<LayoutFault> layout;
  BoardBending bending;
  UncertaintySummary uncertainty;
  std::vector<Eigen::MatrixXd> uncertainty_maps;  ///< per camera (8, 12) px at the median distance of its boards; may be empty
  double rejected_fraction = 0;
  double need_px = 0;  ///< CalibrateOptions::need_px
  double solve_s = 0;  ///< wall time of the joint adjustment
  int num_corners = 0, num_frames = 0;
  Verdict verdict;
};

/// The errors.
template <class Visitor>
void VisitFields(Visitor&& visit, const CalibrateReport& r) {
  visit("rms_px", r.rms_px);
  visit("sigma_px", r.sigma_px);
  visit("holdout_rms_px", r.holdout_rms_px);
  visit("holdout_median_px", r.holdout_median_px);
  visit("holdout_gross_fraction", r.holdout_gross_fraction);
  visit("rig_holdout_rms_px", r.rig_holdout_rms_px);
  visit("rig_holdout_median_px", r.rig_holdout_median_px);
  visit("rig_holdout_gross_fraction", r.rig_holdout_gross_fraction);
  visit("rejected_fraction", r.rejected_fraction);
}

/// Calibrates a rig from board observations: each camera alone, lens model by held-out error, cameras linked by shared
/// boards, joint bundle adjustment with outlier rejection, covariance, verdict. A status other than kOk comes with a
/// message. The rig is then empty or, for kNotConverged and kDegenerate after the adjustment, the best estimate without
/// covariances.
CalibrateReport Calibrate(const CalibrateInput& input, const CalibrateOptions& options, const RunContext& run);

/// pass, warn or fail, with the figures that decided it.
Verdict Judge(const CalibrateReport& report);

}  // namespace mvstudio::calib
