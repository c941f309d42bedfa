// Private: what the shifts of one pair of cameras' frames give, for frame_offset.cc.
#pragma once

#include <cstdint>
#include <vector>

#include "calib/rig/frame_offset.h"
#include "calib/rig/frame_steps.h"

namespace mvstudio::calib {

/// How well the board's places agree at one shift: distances between the board and its transferred place over its distance.
struct ShiftSpread {
  int64_t shift = 0;
  int num_shared = 0;
  double spread = 0, most = 0;  ///< median, and what nine of ten frames keep, in each part
};

/// Relative poses of two cameras along the recording.
enum class RelativePoses {
  kOne,      ///< neither camera moves
  kSeveral,  ///< up to three, one after the other: a camera moved
};

/// All shifts up to options.max_shift at which enough frames are shared.
std::vector<ShiftSpread> ScanShifts(const BoardPoses& a, const BoardPoses& b, RelativePoses poses,
                                    const FrameOffsetOptions& options);

}  // namespace mvstudio::calib
