#pragma once

#include <Eigen/Core>
#include <string>
#include <string_view>
#include <vector>

#include "core/progress.h"
#include "triangulate/people/association.h"

/// When did each camera see what the others saw? Time offsets from the motion of the people in the take, for calibrated
/// cameras.
namespace mvstudio::triangulate {

enum class SyncStatus {
  kOk,
  kTooFewDetections,  ///< too few frames or joints in common with the other cameras
  kNoMotion,          ///< the take does not tell offsets apart: nothing moves enough against the noise, or only for a moment
  kAmbiguous,         ///< several offsets fit alike, as with periodic motion
  kInconsistent,      ///< pairs of cameras contradict each other: wrong footage or calibration
};

/// "Ok", "TooFewDetections", …
std::string_view ToString(SyncStatus status);

struct SyncOptions {
  int max_offset_frames = 180;
  double min_score = 0.3;
  int min_frames = 10;
  double min_overlap = 0.3;
  std::string reference;
};

template <class Visitor>
void VisitFields(Visitor&& visit, SyncOptions& o) {
  visit("max-offset-frames", o.max_offset_frames, "frames; offsets of two cameras are looked for within plus and minus this");
  visit("min-score", o.min_score, "0..1; detections with a lower score are left out");
  visit("min-frames", o.min_frames, "frames that two cameras must have in common at the right offset");
  visit("min-overlap", o.min_overlap, "0..1; the same as a part of the most they can have in common at any offset");
  visit("reference", o.reference, "camera whose clock counts; empty: the one that agrees best with the others");
}

/// Frame `f` of the reference and frame `f + offset_frames` of this camera show the same instant.
struct CameraSync {
  std::string name;
  SyncStatus status = SyncStatus::kTooFewDetections;  ///< the offset is to be used only when kOk
  double offset_frames = 0;
  /// Standard deviation of the offset from how much blocks of the take disagree (0 for the reference); holds for errors of the
  /// detections and for a constant shift of each image, not for other errors of the calibration.
  double sigma_frames = 0;
  int coarse_frames = 0;        ///< best whole offset
  double contrast = 0;          ///< how far the typical offset fits worse than the best: median cost / best cost - 1
  double agreement = 0;         ///< part of 200 resampled takes whose best whole offset lies within 1 frame of this one
  double runner_up_frames = 0;  ///< the next best offset beyond a barrier; NaN: none
  double peak_ratio = 0;        ///< its depth below the median cost over that of the best: 1 fits as well, 0: no runner-up
  int num_pairs = 0;            ///< cameras it has enough in common with
  int num_pairs_disagree = 0;   ///< of these, whose own best offset differs by more than 2 frames
  std::string message;          ///< one line, when not kOk
};

struct SyncResult {
  SyncStatus status = SyncStatus::kTooFewDetections;  ///< kOk when all cameras are, else the status of the first that is not
  int reference_idx = 0;
  std::vector<CameraSync> cameras;  ///< in the rig's order
  double residual_before_px = 0;    ///< median distance of detection and triangulated point with all offsets zero; NaN: none
  double residual_after_px = 0;     ///< with the offsets found; both over the same joints, with the images shifted as found
  int num_points = 0;               ///< triangulated for it
};

/// Offsets of all cameras that have detections.
///
/// Coarse: for each pair of cameras and every whole offset, the mean truncated epipolar distance (Sampson's, in px, on rays
/// through the full lens) about its median, which takes out a constant error of the calibration; people are matched by that
/// distance alone. Then one whole offset a camera that minimises the sum over pairs, by coordinate descent from the spanning
/// tree of the clearest pairs. Decided on resampled blocks of the take: whether the minimum is real, and unique.
///
/// Fine: offsets and a constant shift of each camera's image (free within twice the noise) by robust Gauss-Newton on the
/// reprojection residuals, the points eliminated at each step; tracks of the joints are sampled in time by a local quadratic
/// fit, whose noise does not depend on the fraction of a frame (linear interpolation prefers half frames).
///
/// `frames`: by each camera's own frame numbers, ascending. Throws UsageError for options out of range or an unknown reference.
SyncResult SynchronizeCameras(const PreparedRig& rig, const std::vector<DetectedFrame>& frames, const SyncOptions& options,
                              const RunContext& run = {});

/// The take as the reference would have numbered it: detections of camera c at frame f + offset_frames[c]. Whole offsets (to
/// 1e-6) renumber; others interpolate the joints of a person between the frames before and after (by a cubic through four where
/// they are there, else linearly; scores: the lower one). Gaps stay gaps: a joint or a person missing on either side is
/// missing, and only frames that follow each other are interpolated. NaN offsets leave the camera out.
std::vector<DetectedFrame> ApplyOffsets(const std::vector<DetectedFrame>& frames, const std::vector<double>& offset_frames);

}  // namespace mvstudio::triangulate
