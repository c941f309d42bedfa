#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "calib/keypoint_choice.h"
#include "calib/keypoint_culprit.h"

namespace mvstudio::calib {

struct KeypointRefineOptions {
  double min_score = 0.3;       ///< detections below are left out
  int max_persons = 1;          ///< persons used
  double holdout_scale_px = 3;  ///< see KeypointCost: scale of the points that the held-out figures are taken from
  bool lenses = true;           ///< ask held-out frames whether lenses should be adjusted too
  KeypointChoiceOptions choice;
  int max_frames = 300;  ///< frames used for the adjustment, evenly spread
};

template <class Visitor>
void VisitFields(Visitor&& visit, KeypointRefineOptions& o) {
  visit("min-score", o.min_score, "--from-keypoints: detections with a lower score are left out");
  visit("max-persons", o.max_persons, "--from-keypoints: the best supported so many people are used");
  visit("keypoint-lenses", o.lenses, "--from-keypoints: adjust lenses too where held-out frames say that it pays");
  visit("keypoint-folds", o.choice.num_folds, "--from-keypoints: stretches of time for the choice of what to adjust");
  visit("choice-sigmas", o.choice.sigmas, "--from-keypoints: standard errors by which a change must lower the held-out error");
  visit("keypoint-frames", o.max_frames, "--from-keypoints: at most so many frames, evenly spread, are adjusted to");
  visit("holdout-scale-px", o.holdout_scale_px,
        "px; --from-keypoints: scale of the Cauchy loss of the points that the final figures are taken from");
}

struct KeypointCamera {
  std::string name;
  int num_detections = 0;                             ///< in the test frames, of joints with three views or more
  double rotation_rad = 0, rotation_sigma_rad = 0;    ///< new against given calibration, same frame
  double translation_m = 0, translation_sigma_m = 0;  ///< of its centre
  double focal_change = 0;                            ///< relative
  Eigen::Vector2d mean_residual_before_px = Eigen::Vector2d::Zero();  ///< detection - projection
  Eigen::Vector2d mean_residual_after_px = Eigen::Vector2d::Zero();
};

struct KeypointRefineReport {
  Status status = Status::kOk;  ///< kTooFewViews, kDegenerate, kNonFiniteInput, kBehindCamera: no rig
  std::string message;          ///< one line when the status is not kOk or the input was kept
  geometry::Rig rig;            ///< in the frame and scale of the given one, with covariances; the given one when kept
  bool kept_input = false;      ///< nothing found that is better on the held-out frames
  KeypointError before, after;  ///< on the test frames
  double cauchy_px = 0;         ///< scale of the noise in the train frames
  double sigma_px = 0;          ///< standard deviation per coordinate of a normal variable with the same median length
  int num_train_frames = 0, num_test_frames = 0, num_train_joints = 0;
  KeypointPlan plan;
  std::vector<KeypointDecision> decisions;
  std::vector<KeypointCamera> cameras;  ///< in the rig's order
  KeypointCulprit culprit;
};

/// Adjusts a calibration to people in a take: poses first, then lenses as far as held-out frames ask for it. The decisions and
/// the adjustment see the `train` frames alone, the figures the `test` frames alone; without `test`, the frames that are not in
/// `train`; without both, every second frame. People in several views are told apart by the given rig, then by the adjusted
/// one. `frames` ascend and have one list of people a camera of the rig; `limbs` are pairs of joints.
KeypointRefineReport RefineFromKeypoints(const geometry::Rig& given, const std::vector<triangulate::DetectedFrame>& frames,
                                         const std::vector<std::pair<int, int>>& limbs, const std::optional<FrameChoice>& train,
                                         const std::optional<FrameChoice>& test, const KeypointRefineOptions& options,
                                         const RunContext& run = {});

}  // namespace mvstudio::calib
