#pragma once

#include <Eigen/Core>
#include <string>
#include <string_view>
#include <vector>

#include "core/progress.h"
#include "triangulate/people/association.h"

/// Time offsets between calibrated cameras, from the motion of the people in the take.
namespace mvstudio::triangulate {

enum class SyncStatus {
  kOk,
  kTooFewDetections,  ///< too few frames or joints in common with the other cameras
  kNoMotion,          ///< the take does not determine offsets: too little motion against the noise, or only briefly
  kAmbiguous,         ///< several offsets fit equally well, as with periodic motion
  kInconsistent,      ///< pairs of cameras contradict each other: wrong footage or calibration
};

/// "Ok", "TooFewDetections", …
std::string_view ToString(SyncStatus status);

struct SyncOptions {
  int max_offset_frames = 180;
  double min_score = 0.3;
  int min_frames = 10;
  double min_overlap = 0.3;
  bool find_rates = true;
  std::string reference;
};

template <class Visitor>
void VisitFields(Visitor&& visit, SyncOptions& o) {
  visit("max-offset-frames", o.max_offset_frames, "frames; offsets of two cameras are searched within plus and minus this");
  visit("min-score", o.min_score, "0..1; detections with a lower score are left out");
  visit("min-frames", o.min_frames, "frames that two cameras must have in common at the right offset");
  visit("min-overlap", o.min_overlap, "0..1; the same as a part of the most they can have in common at any offset");
  visit("find-rates", o.find_rates, "look for different frame rates where equal ones do not fit");
  visit("reference", o.reference, "camera whose clock counts; empty: the one that agrees best with the others");
}

/// Frame `f` of the reference and frame `offset_frames + rate * f` of a camera show the same time step.
struct Clock {
  double offset_frames = 0;
  double rate = 1;  ///< frames of the camera for one of the reference
};

/// What the motion says of a camera's clock.
struct CameraSync {
  std::string name;
  SyncStatus status = SyncStatus::kTooFewDetections;  ///< the offset is valid only when kOk
  double offset_frames = 0;
  double nominal_rate = 1;  ///< of kRateCandidates, 1 unless equal rates do not fit
  /// Excess of its frame period over nominal_rate's, in parts per million; 0 unless the motion determines it.
  double rate_ppm = 0, sigma_rate_ppm = 0;
  /// Standard deviation of the offset in the middle of the take (0 for the reference): the larger of what the noise of the
  /// tracks says, which neighbouring frames share, and of the disagreement between blocks of the take. Covers errors of the
  /// detections, a constant shift of each image and the covariance that the rig states.
  double sigma_frames = 0;
  int coarse_frames = 0;        ///< best whole offset
  double contrast = 0;          ///< cost of the typical offset over the best: median cost / best cost - 1
  double agreement = 0;         ///< fraction of 200 resampled takes whose best whole offset lies within 1 frame of this one
  double runner_up_frames = 0;  ///< the next local minimum; NaN: none
  double peak_ratio = 0;        ///< its depth below the median cost over that of the best; 1: fits as well, 0: no runner-up
  int num_pairs = 0;            ///< cameras with enough common data
  int num_pairs_disagree = 0;   ///< of these, those whose own best offset differs by more than 2 frames
  std::string message;          ///< one line, when not kOk

  Clock clock() const { return {offset_frames, nominal_rate / (1 + 1e-6 * rate_ppm)}; }
};

struct SyncResult {
  SyncStatus status = SyncStatus::kTooFewDetections;  ///< kOk when all cameras are, else the status of the first that is not
  int reference_idx = 0;
  std::vector<CameraSync> cameras;  ///< in the rig's order
  double residual_before_px = 0;    ///< median distance between detection and triangulated point with all offsets zero; NaN:
                                    ///< none
  double residual_after_px = 0;     ///< with the estimated offsets; both over the same joints, with the images shifted as
                                    ///< estimated
  int num_points = 0;               ///< points triangulated for these residuals
};

/// Estimates the offsets of all cameras that have detections.
///
/// Coarse: for each pair of cameras and every whole offset, the mean truncated epipolar distance (Sampson's, in px, on
/// rays through the full lens) about its median, which removes a constant error of the calibration. People are matched by
/// that distance alone. Then one whole offset per camera minimises the sum over pairs, by coordinate descent from the
/// spanning tree of the clearest pairs. Resampled blocks of the take decide whether the minimum is significant and unique.
///
/// Fine: offsets and a constant shift of each camera's image (free within twice the noise) by robust Gauss-Newton on the
/// reprojection residuals, with the points eliminated at each step. Tracks of the joints are sampled in time by a local
/// quadratic fit, whose noise does not depend on the fraction of a frame (linear interpolation prefers half frames).
///
/// Clocks are the simplest that explain the motion. Where some camera has no offset at equal rates, ratios of usual frame rates
/// are tried between it and the others, and taken where every camera with detections then has one. A drift is kept when it is 5
/// of its standard deviations and moves the ends of the take by 0.1 frames (of the slowest camera) and more, but no faster than
/// 2000 ppm, as clocks of nearly one rate do.
///
/// `frames`: by each camera's own frame numbers, ascending. Throws UsageError for options out of range or an unknown
/// reference.
SyncResult SynchronizeCameras(const PreparedRig& rig, const std::vector<DetectedFrame>& frames, const SyncOptions& options,
                              const RunContext& run = {});

/// The take with the reference's frame numbers: detections of camera c at frame offset + rate * f of its own. Whole frames
/// (to 1e-6) are taken as they are. Between two frames the joints of a person are interpolated, by a cubic through four
/// where they exist, else linearly; of the scores, the lower one is taken. Gaps remain: a joint or person missing on
/// either side is missing, and only consecutive frames are interpolated. A NaN offset leaves the camera out. Up to
/// `beyond_frames` of the camera's frames before the first and after the last of consecutive frames, the nearest two are
/// extended by a line.
std::vector<DetectedFrame> ApplyClocks(const std::vector<DetectedFrame>& frames, const std::vector<Clock>& clocks,
                                       double beyond_frames = 0);
/// `beyond_frames` for clocks that were measured: cameras that start together have offsets of some thousandths of a frame, of
/// either sign, and their first frame is a time step all the same.
inline constexpr double kMeasuredBeyond = 0.05;  // frames

/// The same with equal rates.
std::vector<DetectedFrame> ApplyOffsets(const std::vector<DetectedFrame>& frames, const std::vector<double>& offset_frames);

}  // namespace mvstudio::triangulate
