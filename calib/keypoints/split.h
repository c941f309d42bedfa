#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calib/keypoints/bundle.h"

namespace mvstudio::calib {

struct KeypointSplit {
  std::vector<KeypointJoint> train, test;
};

/// Splits joints by frame. Without `test`: the frames not in `train`; without `train`: those not in `test`. At least one
/// must be given. Throws UsageError when both contain a frame.
KeypointSplit SplitKeypoints(const std::vector<KeypointJoint>& joints, const std::optional<FrameChoice>& train,
                             const std::optional<FrameChoice>& test);

/// Part index of each of `frames` (ascending) when the take is cut into `num_parts` parts with equal numbers of time
/// steps; -1 in the gaps. A gap removes time steps around the cut until more than `gap_frames` frames lie between the
/// parts: at least 2 time steps, at most a tenth of a part.
std::vector<int> CutWithGaps(const std::vector<int>& frames, int num_parts, int gap_frames);

/// Cuts the take into halves: train holds the time steps of the half `train_half` (0 or 1), test those of the other.
KeypointSplit HalveKeypoints(const std::vector<KeypointJoint>& joints, int train_half, int gap_frames);

/// At most `max_frames` frames, evenly spaced; more where these hold fewer than 30 points each.
std::vector<KeypointJoint> Limited(const std::vector<KeypointJoint>& joints, int max_frames);

/// Why the frames are too few for an adjustment; empty if they suffice. Too few: fewer than 4 frames, or cameras that
/// share fewer than 12 points with the others.
std::string WhyTooFew(const geometry::Rig& rig, const std::vector<KeypointJoint>& train);

/// Why the views that fit together do not determine a camera; empty if they do. The limits are a tenth of the rig's size and
/// 0.1 rad, for what J^T J of the views says. `views_agree`: so is what parts of the take say; where views disagree, parts
/// differ however much they determine.
std::string WhyLoose(const geometry::Rig& rig, const KeypointCovariance& covariance, bool views_agree);

/// Why a rig that the views would determine hangs on which frames are used, by the same limits; empty if it does not.
std::string WhyUnsteady(const geometry::Rig& rig, const KeypointCovariance& covariance);

/// Mean of the camera centres, metres in world.
Eigen::Vector3d MeanCentre(const geometry::Rig& rig);

}  // namespace mvstudio::calib
