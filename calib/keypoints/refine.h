#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "calib/keypoints/choice.h"
#include "calib/keypoints/suspect.h"

namespace mvstudio::calib {

struct KeypointRefineOptions {
  double min_score = 0.3;       ///< detections below are left out
  int max_persons = 1;          ///< maximum number of persons used
  double holdout_scale_px = 3;  ///< see KeypointCost: scale of the points that the held-out figures are taken from
  bool lenses = true;           ///< let held-out frames decide whether lenses are adjusted too
  KeypointChoiceOptions choice;
  int max_frames = 300;  ///< frames used for the adjustment, evenly spaced; more where they hold fewer than 30 points each
};

template <class Visitor>
void VisitFields(Visitor&& visit, KeypointRefineOptions& o) {
  visit("min-score", o.min_score, "option 'from-keypoints': detections with a lower score are left out");
  visit("max-persons", o.max_persons,
        "option 'from-keypoints': people used per frame, the best supported ones; others are reported");
  visit("keypoint-lenses", o.lenses, "option 'from-keypoints': adjust lenses too where held-out frames say that it pays");
  visit("keypoint-folds", o.choice.num_folds, "option 'from-keypoints': stretches of time for the choice of what to adjust");
  visit("choice-sigmas", o.choice.sigmas,
        "option 'from-keypoints': standard errors by which a change must lower the held-out error");
  visit("keypoint-frames", o.max_frames,
        "option 'from-keypoints': maximum number of frames, evenly spread, to adjust to; more where they hold fewer than 30 "
        "points each");
  visit("keypoint-gap-frames", o.choice.gap_frames,
        "option 'from-keypoints': frames left out between what is adjusted to and what measures it, about a second; a tenth of "
        "the take at most");
  visit("holdout-scale-px", o.holdout_scale_px,
        "px; option 'from-keypoints': scale of the Cauchy loss of the points that the final figures are taken from");
}

struct KeypointCamera {
  std::string name;
  int num_detections = 0;                             ///< in the test frames, of joints with three views or more
  double rotation_rad = 0, rotation_sigma_rad = 0;    ///< new against given calibration, in the same world frame
  double translation_m = 0, translation_sigma_m = 0;  ///< of its centre
  double focal_change = 0;                            ///< relative
  Eigen::Vector2d mean_residual_before_px = Eigen::Vector2d::Zero();  ///< observed minus projected, as given
  Eigen::Vector2d mean_residual_after_px = Eigen::Vector2d::Zero();   ///< observed minus projected, as adjusted
};

/// Error on one part of the take of a rig adjusted to another part.
struct KeypointHeldOut {
  std::string name;  ///< "first half", "second half"; "test frames"
  int first_frame = 0, last_frame = 0;
  int num_frames = 0, num_train_frames = 0;
  bool kept_input = false;      ///< the adjustment found nothing better than the given rig
  KeypointError before, after;  ///< of the given rig, of the adjusted one
};

struct KeypointRefineReport {
  Status status = Status::kOk;  ///< kTooFewViews, kDegenerate, kNonFiniteInput, kBehindCamera: no rig
  std::string message;          ///< one line when the status is not kOk or the input was kept
  geometry::Rig rig;            ///< in the frame and scale of the given one, with covariances; the given one when kept
  bool kept_input = false;      ///< nothing was better on the held-out frames
  KeypointError before, after;  ///< on all held-out frames
  std::vector<KeypointHeldOut> held_out;
  int num_gap_frames = 0;          ///< time steps between the halves that belong to neither
  std::string unsteady;            ///< one line where parts of the take ask for different rigs, or a camera fits none
  std::vector<std::string> notes;  ///< one line each: a half that cannot be adjusted to, and why
  std::string lenses;              ///< one line: what does not hold freed lens terms
  LeftOutPersons left_out;
  double cauchy_px = 0;  ///< scale of the noise in the train frames
  double sigma_px = 0;   ///< standard deviation per coordinate of a normal variable with the same median length
  int num_train_frames = 0, num_test_frames = 0, num_train_joints = 0;
  KeypointPlan plan;
  std::vector<KeypointDecision> decisions;
  std::vector<KeypointCamera> cameras;  ///< in the rig's order
  KeypointSuspect suspect;
};

/// Adjusts a calibration to points that several cameras see at once: people's joints, markers, a wand. Poses first, then
/// lenses as far as held-out frames support it. People in several views are associated by the given rig, then by the
/// adjusted one.
///
/// Without `train` and `test` the take is cut into two halves with a gap (CutWithGaps). The whole procedure, decisions
/// included, runs on each half alone and is measured on the other; these are the held-out figures. The rig of the report
/// is adjusted to all frames. The input is kept when the halves' rigs do not explain the other halves better than the
/// given one, or where poses alone were adjusted and distances between points that stay the same scatter more in them. A half
/// that is too small for an adjustment gives no figure; at least one must.
///
/// With `train` or `test`, decisions and rig use the train frames alone, and the figures the test frames alone, without
/// gaps between them. Without `test` these are the frames that are not in `train`.
///
/// `frames` ascend and hold one list of people per camera of the rig; `limbs` are pairs of joints.
KeypointRefineReport RefineFromKeypoints(const geometry::Rig& given, const std::vector<triangulate::DetectedFrame>& frames,
                                         const std::vector<std::pair<int, int>>& limbs, const std::optional<FrameChoice>& train,
                                         const std::optional<FrameChoice>& test, const KeypointRefineOptions& options,
                                         const RunContext& run = {});

}  // namespace mvstudio::calib
