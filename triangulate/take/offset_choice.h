#pragma once

#include <string>
#include <vector>

#include "core/progress.h"
#include "triangulate/take/take.h"

/// Do time offsets from another recording hold in this take?
namespace mvstudio::triangulate {

struct OffsetTrial {
  bool confirmed = false;
  std::string reason;                                         ///< one line, with the figures
  double without_px = 0, with_px = 0, reversed_px = 0;        ///< medians with one camera left out; NaN where there are none
};

/// Offsets that were found in another recording hold when the cameras kept their clocks in between, which no file says. The take
/// does: with the offsets (ApplyOffsets) left-out cameras are predicted better than without, and better than with the offsets
/// reversed, each by two standard errors of the difference. Reversed offsets interpolate the detections as much as the right ones
/// do, and so lower their noise as much: what is left is the time. `frames` by each camera's own numbers; up to 240 of them count,
/// evenly spread. Offsets that are NaN leave a camera as it is.
OffsetTrial TryOffsets(const geometry::Rig& rig, const std::vector<DetectedFrame>& frames, const std::vector<double>& offset_frames,
                       const TakeBody& body, const TakeOptions& options, const RunContext& run = {});

}  // namespace mvstudio::triangulate
