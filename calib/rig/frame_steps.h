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

/// Do the numbers of b's frames run apart from a's along the recording, as with dropped or repeated frames, or a clock that drifts?
/// Among all relative poses of the two cameras that single frames give, and all sequences of shifts within 6 frames of
/// `base_shift`, the one that explains the board's places best (dynamic programming; a change of the shift costs 8 nats). The steps
/// of that sequence, the first of them at b's first frame, where it explains them by 15 nats more than one shift for all; else none.
std::vector<FrameStep> FindFrameSteps(const BoardPoses& a, const BoardPoses& b, int64_t base_shift);

}  // namespace mvstudio::calib
