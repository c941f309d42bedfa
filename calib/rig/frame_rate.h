#pragma once

#include <cstdint>
#include <optional>

#include "calib/rig/frame_steps.h"

/// Cameras that count frames at different rates: 30 and 60 a second, 25 and 30.
namespace mvstudio::calib {

/// Frame f of camera b was taken with frame numerator / denominator * f + offset of camera a.
struct FrameRate {
  int numerator = 1, denominator = 1;
  int64_t offset = 0;

  bool same() const { return numerator == denominator; }
  /// Nothing where it falls between two frames of a.
  std::optional<int64_t> At(int64_t frame) const;
  /// The same with a and b exchanged, as near as whole offsets allow.
  FrameRate Inverse() const;
};

/// The ratio of small numbers and the offset, within 60 frames, at which the board positions of two cameras agree; by the
/// spread of their relative pose (FindFrameOffsets). Empty unless nine of ten frames agree then to half of what they do at
/// equal rates with any offset, and to half of what unrelated frames do.
std::optional<FrameRate> FindFrameRate(const BoardPoses& a, const BoardPoses& b);

}  // namespace mvstudio::calib
