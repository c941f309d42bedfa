#pragma once

#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include "geometry/rigid/rigid3.h"

namespace mvstudio::calib {

/// Board poses of a camera, cam_from_board, by (frame, board).
using BoardPoses = std::map<std::pair<int64_t, int>, geometry::Rigid3>;

/// From this frame of camera b on, frame f of b was taken with frame f + shift of camera a.
struct FrameStep {
  int64_t frame = 0, shift = 0;
};

/// Detects frame numbers of b that drift against a's along the recording, as with dropped or repeated frames or a drifting
/// clock. Searches all sequences of shifts within 6 frames of `base_shift` by dynamic programming, with all relative poses
/// of the two cameras that single frames give. Each change of the shift costs 8 nats. Returns the steps of the sequence
/// that explains the board positions best, the first of them at b's first frame. Empty unless it gains 15 nats over one
/// constant shift.
std::vector<FrameStep> FindFrameSteps(const BoardPoses& a, const BoardPoses& b, int64_t base_shift);

}  // namespace mvstudio::calib
