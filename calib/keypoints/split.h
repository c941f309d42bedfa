#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calib/keypoints/bundle.h"

namespace mvstudio::calib {

struct KeypointSplit {
  std::vector<KeypointJoint> train, test;
};

/// Joints by their frames: without `test`, the frames that are not in `train`; without `train`, those not in `test`. One of
/// them must be given. Throws UsageError when both contain a frame.
KeypointSplit SplitKeypoints(const std::vector<KeypointJoint>& joints, const std::optional<FrameChoice>& train,
                             const std::optional<FrameChoice>& test);

/// Which part of a take each of `frames` (ascending) belongs to when it is cut into `num_parts` of as many instants each; -1 in
/// the gaps between them. A gap leaves out the instants around the cut until more than `gap_frames` frames lie between the
/// parts, at least 2 instants, and never more than a tenth of a part.
std::vector<int> CutWithGaps(const std::vector<int>& frames, int num_parts, int gap_frames);

/// The take cut into halves: train holds the instants of the half `train_half` (0 or 1), test those of the other.
KeypointSplit HalveKeypoints(const std::vector<KeypointJoint>& joints, int train_half, int gap_frames);

/// At most `max_frames` frames, evenly spread; more where these hold fewer than 30 points each.
std::vector<KeypointJoint> Limited(const std::vector<KeypointJoint>& joints, int max_frames);

/// Why the frames cannot carry an adjustment, or nothing: fewer than 4 of them, or cameras that share fewer than 12 points with
/// the others.
std::string WhyTooFew(const geometry::Rig& rig, const std::vector<KeypointJoint>& train);

/// Why a solution is none, or nothing: a camera is uncertain by more than a tenth of the rig's size, or 0.1 rad.
std::string WhyLoose(const geometry::Rig& rig, const KeypointCovariance& covariance);

/// Mean of the camera centres, metres in world.
Eigen::Vector3d MeanCentre(const geometry::Rig& rig);

}  // namespace mvstudio::calib
