#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calib/keypoint_bundle.h"

namespace mvstudio::calib {

struct KeypointSplit {
  std::vector<KeypointJoint> train, test;
};

/// Joints by their frames: without `test`, the frames that are not in `train`; without `train`, those not in `test`; without
/// both, every second frame each. At most `max_frames` frames of train. Throws UsageError when both contain a frame.
KeypointSplit SplitKeypoints(const std::vector<KeypointJoint>& joints, const std::optional<FrameChoice>& train,
                             const std::optional<FrameChoice>& test, int max_frames);

/// Why the frames cannot carry an adjustment, or nothing: fewer than 4 train frames, no test frames, or cameras that share
/// fewer than 12 joints with the others.
std::string WhyTooFew(const geometry::Rig& rig, const KeypointSplit& split);

/// Why a solution is none, or nothing: a camera is uncertain by more than a tenth of the rig's size, or 0.1 rad.
std::string WhyLoose(const geometry::Rig& rig, const KeypointCovariance& covariance);

/// Mean of the camera centres, metres in world.
Eigen::Vector3d MeanCentre(const geometry::Rig& rig);

}  // namespace mvstudio::calib
