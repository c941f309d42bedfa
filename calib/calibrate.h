#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "calib/board.h"
#include "calib/bundle.h"
#include "calib/detection.h"
#include "core/progress.h"
#include "core/status.h"
#include "geometry/rig.h"

namespace mvstudio::calib {

struct CalibrateOptions {
  std::string model = "auto";    ///< a lens model by name, or auto: the simplest that held-out boards justify, for all cameras
  std::string world = "camera";  ///< camera[:NAME] (the first one without a name) or board:FRAME
  int holdout_folds = 10;        ///< folds of the held-out error; 0 leaves it out
  int holdout_views = 60;        ///< at most so many views of a camera take part in it
  BundleOptions bundle;
};

template <class Visitor>
void VisitFields(Visitor&& visit, CalibrateOptions& o) {
  visit("model", o.model,
        "pinhole, brown1, brown2, brown4, brown5, rational8, kannala4, or auto: the simplest that held-out boards justify");
  visit("world", o.world, "camera, camera:NAME, or board:FRAME (board lying face up: z up, x along its columns)");
  visit("holdout-folds", o.holdout_folds, "folds of the held-out error; 0 leaves it out");
  visit("holdout-views", o.holdout_views, "at most so many views of a camera take part in the held-out error");
  VisitFields(visit, o.bundle);
}

struct CameraInput {
  std::string name;
  int width_px = 0, height_px = 0;
};

struct CalibrateInput {
  Board board;
  std::vector<CameraInput> cameras;
  std::vector<Detection> detections;
  int num_corners_dropped = 0;  ///< corners that the detector found and dropped, for rejected_fraction
};

/// A corner after the adjustment.
struct CornerResidual {
  int camera_idx = 0;
  int64_t frame_idx = 0;
  int corner_id = 0;
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  Eigen::Vector2d residual_px = Eigen::Vector2d::Zero();  ///< projection minus observation
  bool rejected = false;
};

struct CameraReport {
  std::string name;
  geometry::LensModel model = geometry::LensModel::kPinhole;
  std::string model_reason;
  int num_params = 0, num_views = 0, num_corners = 0, num_rejected = 0;
  double focal_px = 0, focal_sigma_px = 0;  ///< mean of fx and fy
  double rms_px = 0;
  double holdout_rms_px = 0, holdout_median_px = 0;  ///< NaN when there are too few views
  double coverage = 0;                               ///< share of the cells of a 10 x 8 grid over the image that hold a corner
  double valid_radius = 0;                           ///< of the lens model, see geometry::Projector
  bool covers_image = true;                          ///< all image corners lie within the valid radius
};

struct Verdict {
  struct Reason {
    std::string code;  ///< stable: CAL-HOLDOUT, CAL-REJECTED, CAL-FOCAL, CAL-FEWVIEWS, CAL-LOWCOV, CAL-FOLD, CAL-UNSOLVED
    std::string text;  ///< one line: camera, figure, limit
    std::string hint;  ///< what to do
  };
  std::string status = "pass";  ///< pass, warn or fail
  std::vector<Reason> reasons;  ///< empty for pass
};

struct CalibrateReport {
  Status status = Status::kOk;
  std::string message;  ///< one line when the status is not kOk
  geometry::Rig rig;    ///< with covariances, when the status allows
  std::vector<int64_t> frames;
  std::vector<geometry::Rigid3> world_from_board;
  std::vector<CameraReport> cameras;
  std::vector<CornerResidual> residuals;
  std::vector<std::vector<int>> components;  ///< groups of cameras linked by shared boards
  double rms_px = 0, sigma_px = 0;           ///< 2-D RMS over kept corners; standard deviation per coordinate
  double holdout_rms_px = 0, holdout_median_px = 0;
  double rejected_fraction = 0;
  int num_corners = 0, num_frames = 0;
  std::string gauge;
  Verdict verdict;
};

/// Boards in, calibrated rig out: each camera by itself, lens model by held-out error, cameras chained over shared boards,
/// joint bundle adjustment with outlier rejection, covariance, verdict. A status other than kOk comes with a message; the rig
/// is then empty or, for kNotConverged and kDegenerate after the adjustment, the best so far without covariances.
CalibrateReport Calibrate(const CalibrateInput& input, const CalibrateOptions& options, const RunContext& run);

/// pass, warn or fail, with the figures that decided.
Verdict Judge(const CalibrateReport& report);

}  // namespace mvstudio::calib
