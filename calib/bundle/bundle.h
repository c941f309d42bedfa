#pragma once

#include <string>
#include <vector>

#include "calib/bundle/view.h"
#include "core/status.h"

namespace mvstudio::calib {

/// What stays fixed so that the solution is unique.
struct Gauge {
  enum class Kind { kCamera, kBoard, kNone };
  Kind kind = Kind::kCamera;  ///< kNone: cameras in BundleOptions::fix_camera hold the frame
  int index = 0;              ///< of the camera whose cam_from_world, or the frame whose world_from_board, is fixed
};

/// Prior on a lens, independent of the boards: (param - mean)^2 * weight is added to the cost for every parameter.
struct LensPrior {
  Eigen::VectorXd mean;    ///< (P), units of Camera::params
  Eigen::VectorXd weight;  ///< (P), px^2 over those units squared: (sigma of a corner of weight 1 / sigma of the parameter)^2
  int num_omitted = 0;     ///< number of last parameters that the lens was chosen without; they are at zero (omitted_terms.h)
};

struct BundleOptions {
  Gauge gauge;
  bool refine_intrinsics = true;
  bool refine_cameras = true;              ///< cam_from_world
  bool refine_boards = true;               ///< rig_from_board of all boards but the first
  bool refine_warp = false;                ///< board_warp_m
  bool refine_stretch = false;             ///< board_stretch
  bool refine_time = false;                ///< time_offset_frames of all cameras but `time_reference`
  bool refine_rate = false;                ///< with refine_time: time_rate, too
  int time_reference = 0;                  ///< the camera whose capture times are those of the frames
  std::vector<bool> fix_lens, fix_camera;  ///< per camera; empty: none
  std::vector<bool> fix_board;             ///< per board: rig_from_board stays; empty: the first alone
  std::vector<LensPrior> lens_prior;       ///< per camera; empty, or with empty vectors: none
  bool reject_outliers = true;             ///< also estimate the cameras' noise; if false, weights stay unchanged
  bool each_camera_noise = true;           ///< a noise level per camera; false: one for all
  double reject_sigmas = 5.5;              ///< a corner farther than this many standard deviations (per coordinate) is rejected
  double spline_size_weight = 1e-3, spline_smooth_weight = 1e-3;  ///< of the prior on splined lenses, per px
  double cost_tolerance = 1e-13;                                  ///< relative decrease at which the last adjustment stops
  double first_damping = 1e-4;                                    ///< of the last adjustment, see SchurLmOptions
  int max_iterations = 100;
  int num_threads = 1;
};

template <class Visitor>
void VisitFields(Visitor&& visit, BundleOptions& o) {
  visit("reject-outliers", o.reject_outliers, "reject single corners that disagree with the solution");
  visit("each-camera-noise", o.each_camera_noise,
        "estimate every camera's noise and weigh and reject by it; without, one noise for all");
  visit("reject-sigmas", o.reject_sigmas, "standard deviations (per coordinate) beyond which a corner is rejected");
}

struct BundleReport {
  Status status = Status::kOk;  ///< kTooFewViews, kNonFiniteInput, kBehindCamera (the start is unusable), kNotConverged
  std::string message;          ///< one line when the status is not kOk
  double rms_px = 0;            ///< 2-D point RMS over the corners that were kept
  double sigma_px = 0;          ///< standard deviation per coordinate of a corner of weight 1, corrected for the degrees of
                                ///< freedom
  std::vector<double> camera_sigma_px;  ///< per camera: of a corner whose initial weight is 1; NaN without corners
  int num_corners = 0, num_rejected = 0, num_iterations = 0;
};

/// Joint least squares of all reprojection errors over lenses, cameras, boards and whatever else the options free, started
/// at `state` (SolveSchurLm). The first pass uses robust weights (Cauchy). Outliers are then rejected (weight 0) and the
/// last pass is without robust weights. Triggs et al., "Bundle adjustment - a modern synthesis", 1999.
BundleReport SolveBundle(std::vector<View>* views, RigState* state, const BundleOptions& options);

/// Estimates the boards' velocity and acceleration per frame, from the polynomial through its pose and those of the nearest
/// observed frames before and after (RigState::motion): a parabola through three, a quartic through five. With neighbours
/// on one side alone, from those; zero without any. Frames without observation get the pose interpolated from their
/// neighbours.
void EstimateMotion(const std::vector<View>& views, RigState* state);

/// Residuals (2, N) of every view at `state`, px, projected minus observed; infinite where a corner does not project.
std::vector<Eigen::Matrix2Xd> BundleResiduals(const std::vector<View>& views, const RigState& state);

}  // namespace mvstudio::calib
