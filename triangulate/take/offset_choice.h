#pragma once

#include <string>
#include <vector>

#include "core/progress.h"
#include "triangulate/take/take.h"

/// Tests whether time offsets from another recording hold in this take.
namespace mvstudio::triangulate {

struct OffsetTrial {
  bool confirmed = false;
  std::string reason;                                         ///< one line, with the figures
  double without_px = 0, with_px = 0, reversed_px = 0;        ///< medians of the leave-one-camera-out errors; NaN where there
                                                              ///< are none
};

/// Offsets from another recording hold if the cameras kept their clocks in between, which no file states. They are
/// confirmed if, with the offsets (ApplyOffsets), left-out cameras are predicted better than without them and better than
/// with reversed offsets, each by two standard errors of the difference. Reversed offsets are the control: their
/// interpolation lowers the noise of the detections as much, so the remaining difference is due to time.
///
/// `frames` by each camera's own numbers; up to 240 of them are used, evenly spaced. Offsets that are NaN leave a camera
/// unchanged.
OffsetTrial TryOffsets(const geometry::Rig& rig, const std::vector<DetectedFrame>& frames, const std::vector<double>& offset_frames,
                       const TakeBody& body, const TakeOptions& options, const RunContext& run = {});

}  // namespace mvstudio::triangulate
