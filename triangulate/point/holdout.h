#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "core/status.h"
#include "triangulate/point/prepared_rig.h"
#include "triangulate/point/types.h"

/// The figure that chooses methods: leave one camera out, triangulate from the others, reproject into the one left out.
///
/// What counts. A *sample* is one detection of a point that at least two other cameras (copies of the left-out camera under
/// another name apart) observe: the set of samples depends on the detections alone, never on the method. A method that gives up
/// on a sample (any status but kOk) is taken to be infinitely wrong there, so refusing never lowers a quantile over all
/// samples; and as only the rank counts, refusing what would have come out worse than the median anyway costs nothing.
/// `coverage` is the fraction predicted. Means and quantiles over predicted samples alone are reported under names that say so
/// and choose nothing.
namespace mvstudio::triangulate {

using PointSolver = std::function<Point(const std::vector<Observation>&)>;

/// What the other cameras say of one detection. Residual and covariance are to be read only when `status` is kOk.
struct LeftOutSample {
  size_t point = 0;  ///< index into the points
  int camera_idx = 0;
  Status status = Status::kTooFewViews;                      ///< of the point, or of its projection into the left-out camera
  Eigen::Vector2d residual_px = Eigen::Vector2d::Zero();     ///< detection - projection
  Eigen::Matrix2d covariance_px2 = Eigen::Matrix2d::Zero();  ///< predicted: detection and propagated covariance of the point
  double sigma_px = 0;                                       ///< sqrt(trace / 2) of it
};

/// All samples, by point and then in the order of its observations. `solve` gets the other observations in their order, must be
/// callable from several threads, and may return any status. The result does not depend on the number of threads.
std::vector<LeftOutSample> LeaveOneCameraOut(const PreparedRig& rig, const std::vector<std::vector<Observation>>& points,
                                             const PointSolver& solve, int num_threads);

/// True when leaving out the camera of observation `i` leaves two other cameras (copies counted once): then it is a sample.
bool IsLeftOutSample(const PreparedRig& rig, const std::vector<Observation>& observations, size_t i);

/// One sample by hand, for methods that do not triangulate point by point: `point` from the cameras other than that of `seen`.
LeftOutSample PredictLeftOut(const PreparedRig& rig, const Observation& seen, const Point& point, size_t point_idx);

/// What `observations` are left without the camera of `camera_idx` and its copies.
std::vector<Observation> WithoutCamera(const PreparedRig& rig, const std::vector<Observation>& observations, int camera_idx);

/// Where a point belongs.
struct PointLabel {
  int frame = 0, person = 0, joint_idx = 0;
};

/// Distances |residual| over a set of samples. NaN where there is nothing to take them of, infinity where a quantile falls on a
/// refused sample.
struct LeftOutFigures {
  int num_samples = 0, num_predicted = 0;
  double coverage = 0;             ///< num_predicted / num_samples
  double median_px = 0;            ///< over all samples, refused ones infinite
  double median_error_px = 0;      ///< its standard error, see SummarizeLeftOut
  double p90_px = 0;               ///< over all samples, refused ones infinite
  double predicted_median_px = 0;  ///< over predicted samples
  double predicted_mean_px = 0;
  double predicted_p90_px = 0;
  double median_sigmas = 0;  ///< median of the Mahalanobis distance; 1.18 = sqrt(2 ln 2) where the covariances are honest
};

struct LeftOutSummary {
  LeftOutFigures all;
  std::vector<LeftOutFigures> cameras;  ///< in the rig's order, by the camera left out
  std::vector<LeftOutFigures> joints;   ///< by joint_idx
};

/// Standard errors by a seeded bootstrap (200 draws) over blocks of consecutive frames: the joints of a frame err together and
/// so do neighbouring frames. Up to 25 blocks; fewer frames are a block each. They hold for this take and calibration: an error
/// of the calibration is the same in every frame and does not show.
LeftOutSummary SummarizeLeftOut(const PreparedRig& rig, const std::vector<LeftOutSample>& samples,
                                const std::vector<PointLabel>& labels);

struct PairedDifference {
  int num_samples = 0;         ///< that at least one of the two predicts; a refusal counts as infinite
  double median_px = 0;        ///< of b minus that of a
  double median_error_px = 0;  ///< standard error of the difference: both medians over the same draws of the bootstrap
  double p90_px = 0;           ///< the same of the 90 % quantile; 0 where both are infinite
  double p90_error_px = 0;
};

/// How much larger the errors of `b` are than those of `a`, two runs of LeaveOneCameraOut over the same points. Samples that
/// neither predicts say nothing of their difference and are left out.
PairedDifference CompareLeftOut(const std::vector<LeftOutSample>& a, const std::vector<LeftOutSample>& b,
                                const std::vector<PointLabel>& labels);

struct MethodCandidate {
  std::string name;
  double cost = 0;  ///< rank or seconds a point
  PointSolver solve;
};

struct MethodScore {
  std::string name;
  double cost = 0;
  LeftOutFigures figures;      ///< over the samples that any of the candidates predicts
  PairedDifference from_best;  ///< this method minus the best
  bool justified = false;      ///< as good as the best
};

struct MethodChoice {
  Status status = Status::kOk;      ///< kTooFewViews: too few samples to choose by; `chosen` is then the first candidate
  size_t chosen = 0;                ///< index into the candidates
  size_t best = 0;                  ///< the one with the lowest median
  std::vector<MethodScore> scores;  ///< one a candidate, in their order
  std::string reason;               ///< one line
};

struct MethodChoiceOptions {
  int max_points = 2000;    ///< evenly spread over the points with 3 observations or more
  int min_samples = 50;     ///< fewer choose nothing
  double tolerance = 0.01;  ///< of the best median: a gain below it is not worth a dearer method
};

/// The cheapest candidate as good as the best: its median exceeds that of the best by no more than one standard error of their
/// paired difference (or `tolerance`), and so does its 90 % quantile, so that a method which fails on every fifth point does
/// not pass by its median. Candidates: at least one; list first what to use when nothing can be measured.
MethodChoice ChooseMethod(const PreparedRig& rig, const std::vector<std::vector<Observation>>& points,
                          const std::vector<PointLabel>& labels, const std::vector<MethodCandidate>& candidates,
                          const MethodChoiceOptions& options, int num_threads);

}  // namespace mvstudio::triangulate
