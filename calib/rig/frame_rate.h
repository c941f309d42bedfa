#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "calib/rig/frame_offset.h"
#include "calib/rig/frame_steps.h"

/// Cameras that count frames at different rates: 30 and 60 a second, 25 and 30.
namespace mvstudio::calib {

/// Frame f of a camera was taken with frame (numerator * f + offset) / denominator of another.
struct FrameRate {
  int numerator = 1, denominator = 1;
  int64_t offset = 0;

  bool same() const { return numerator == denominator; }
  /// Nothing where it falls between two frames of the other.
  std::optional<int64_t> At(int64_t frame) const;
  /// The same with the cameras exchanged.
  FrameRate Inverse() const { return {denominator, numerator, -offset}; }
};

/// From frames of b to frames of a. The ratio of small numbers and the offset, within 60 frames, at which the board positions
/// of two cameras agree; by the spread of their relative pose (FindFrameOffsets). Empty unless four of ten frames that it could
/// pair are paired, and nine of ten of these agree to half of what they do at equal rates with any offset, and to half of what
/// unrelated frames do.
std::optional<FrameRate> FindFrameRate(const BoardPoses& a, const BoardPoses& b, const BoardTurns& turns = {});

/// Per camera, how its frames count in those of the others, from the pairs that `offsets` found inconsistent; empty when no
/// ratio makes one of them agree. Of two cameras the slower one is renumbered. Arguments as for FindFrameOffsets.
std::vector<FrameRate> FindFrameRates(const std::vector<View>& views, const std::vector<geometry::Rigid3>& cam_from_board,
                                      const std::vector<int64_t>& frames, const FrameOffsets& offsets,
                                      const BoardTurns& turns = {});

/// "frames of cam1 count 2 frames of the others each (its frame f is their frame 2 f + 3)", for the renumbered cameras.
std::string ToString(const std::vector<FrameRate>& rates, const std::vector<std::string>& camera_names);

/// Renumbers the frames of such cameras. Those that fall between two frames of the others are left out, and so is a second one
/// of the same frame.
void ApplyFrameRates(const std::vector<FrameRate>& rates, std::vector<Detection>* detections);

}  // namespace mvstudio::calib
