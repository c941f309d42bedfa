// Private: the numbers of 3D joints against those of frames, for BuildDataset.
#pragma once

#include <vector>

#include "core/notice.h"
#include "dataset/build/build.h"
#include "dataset/pose/pose3d.h"

namespace mvstudio::dataset::internal {

/// Gives joints the numbers of their frames where those count from 0 and the joints from `first_frame`, or, where that is 0,
/// from 1 for sure (FirstNumber::kOne for every camera). Says so, and where it is unclear. Joints of a timeline keep their time
/// steps. Throws FormatError for joints before `first_frame`.
void NumberJointsAsFrames(const BuildInputs& inputs, Pose3d* pose, std::vector<Notice>* notices);

}  // namespace mvstudio::dataset::internal
