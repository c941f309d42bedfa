#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "core/status.h"
#include "triangulate/point/prepared_rig.h"
#include "triangulate/point/types.h"

/// The figure that selects methods: leave one camera out, triangulate from the others, project into the one left out.
///
/// A *sample* is one detection of a point that at least two other cameras observe, not counting copies of the left-out
/// camera under another name. The set of samples depends on the detections alone, never on the method. A method that fails
/// on a sample (any status but kOk) counts as infinitely wrong there, so failing never lowers a quantile over all samples.
/// Only the rank counts: failing where the error would exceed the median anyway costs nothing.
///
/// `coverage` is the fraction predicted. Means and quantiles over predicted samples alone have names that say so and
/// select nothing.
namespace mvstudio::triangulate {

using PointSolver = std::function<Point(const std::vector<Observation>&)>;

/// Prediction of one detection by the other cameras. Residual and covariance are valid only when `status` is kOk.
struct LeftOutSample {
  size_t point = 0;  ///< index into the points
  int camera_idx = 0;
  Status status = Status::kTooFewViews;                      ///< of the point, or of its projection into the left-out camera
  Eigen::Vector2d residual_px = Eigen::Vector2d::Zero();     ///< observed minus projected
  Eigen::Matrix2d covariance_px2 = Eigen::Matrix2d::Zero();  ///< predicted: detection and propagated covariance of the point
  double sigma_px = 0;                                       ///< sqrt(trace / 2) of it
};

/// All samples, by point and then in the order of its observations. Of a point with more than 32 detections every second, third
/// … is left out, another one in the next point, so that the time grows with the cameras and not with their square. `solve`
/// receives the other observations in their order, must be callable from several threads, and may return any status. The result
/// does not depend on the number of threads.
std::vector<LeftOutSample> LeaveOneCameraOut(const PreparedRig& rig, const std::vector<std::vector<Observation>>& points,
                                             const PointSolver& solve, int num_threads);

/// True when leaving out the camera of observation `i` leaves two other cameras (copies counted once): then it is a sample.
bool IsLeftOutSample(const PreparedRig& rig, const std::vector<Observation>& observations, size_t i);

/// One sample computed directly, for methods that do not triangulate point by point: `point` comes from the cameras other
/// than that of `seen`.
LeftOutSample PredictLeftOut(const PreparedRig& rig, const Observation& seen, const Point& point, size_t point_idx);

/// The observations without those of camera `camera_idx` and its copies.
std::vector<Observation> WithoutCamera(const PreparedRig& rig, const std::vector<Observation>& observations, int camera_idx);

/// Frame, person and joint of a point.
struct PointLabel {
  int frame = 0, person = 0, joint_idx = 0;
};

/// Statistics of |residual| over a set of samples. NaN for an empty set, infinity where a quantile falls on a failed
/// sample.
struct LeftOutFigures {
  int num_samples = 0, num_predicted = 0;
  double coverage = 0;             ///< num_predicted / num_samples
  double median_px = 0;            ///< over all samples, failed ones infinite
  double median_error_px = 0;      ///< its standard error, see SummarizeLeftOut
  double p90_px = 0;               ///< over all samples, failed ones infinite
  double predicted_median_px = 0;  ///< over predicted samples
  double predicted_mean_px = 0;
  double predicted_p90_px = 0;
  double median_sigmas = 0;  ///< median of the Mahalanobis distance; 1.18 = sqrt(2 ln 2) for correct covariances
};

struct LeftOutSummary {
  LeftOutFigures all;
  std::vector<LeftOutFigures> cameras;  ///< in the rig's order, by the camera left out
  std::vector<LeftOutFigures> joints;   ///< by joint_idx
};

/// Standard errors by a seeded bootstrap (200 draws) over blocks of consecutive frames, because errors within a frame and
/// of neighbouring frames are correlated. Up to 25 blocks; with fewer frames, one block per frame. They hold for this take
/// and calibration: a calibration error is the same in every frame and does not show.
LeftOutSummary SummarizeLeftOut(const PreparedRig& rig, const std::vector<LeftOutSample>& samples,
                                const std::vector<PointLabel>& labels);

struct PairedDifference {
  int num_samples = 0;         ///< that at least one of the two predicts; a failure counts as infinite
  double median_px = 0;        ///< median of b minus that of a
  double median_error_px = 0;  ///< standard error of the difference: both medians over the same draws of the bootstrap
  double p90_px = 0;           ///< the same of the 90 % quantile; 0 where both are infinite
  double p90_error_px = 0;
};

/// Difference of the errors of `b` and `a`, two runs of LeaveOneCameraOut over the same points. Samples that neither
/// predicts are left out.
PairedDifference CompareLeftOut(const std::vector<LeftOutSample>& a, const std::vector<LeftOutSample>& b,
                                const std::vector<PointLabel>& labels);

struct MethodCandidate {
  std::string name;
  double cost = 0;  ///< rank, or seconds per point
  PointSolver solve;
};

struct MethodScore {
  std::string name;
  double cost = 0;
  LeftOutFigures figures;      ///< over the samples that any candidate predicts
  PairedDifference from_best;  ///< this method minus the best
  bool justified = false;      ///< as good as the best
};

struct MethodChoice {
  Status status = Status::kOk;      ///< kTooFewViews: too few samples for a choice; `chosen` is then the first candidate
  size_t chosen = 0;                ///< index into the candidates
  size_t best = 0;                  ///< the one with the lowest median
  std::vector<MethodScore> scores;  ///< one per candidate, in their order
  std::string reason;               ///< one line
};

struct MethodChoiceOptions {
  int max_points = 2000;    ///< evenly spaced over the points with 3 observations or more
  int min_samples = 50;     ///< with fewer, no choice is made
  double tolerance = 0.01;  ///< of the best median: a smaller gain does not justify a more expensive method
};

/// Chooses the cheapest candidate that is as good as the best: its median exceeds that of the best by at most one standard
/// error of their paired difference (or `tolerance`). The same holds for its 90 % quantile, so that a method that fails on
/// every fifth point does not pass by its median. At least one candidate; the first is used when nothing can be measured.
MethodChoice ChooseMethod(const PreparedRig& rig, const std::vector<std::vector<Observation>>& points,
                          const std::vector<PointLabel>& labels, const std::vector<MethodCandidate>& candidates,
                          const MethodChoiceOptions& options, int num_threads);

}  // namespace mvstudio::triangulate
