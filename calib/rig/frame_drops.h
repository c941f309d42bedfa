#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "calib/board/observations.h"
#include "calib/rig/frame_offset.h"

/// Cameras that lost frames, the rest of which are numbered as if none were missing.
namespace mvstudio::calib {

/// From `frame` on, as the camera numbers them, its frames were taken `count` frames later than their numbers say.
struct FrameDrop {
  int camera_idx = 0;
  int64_t last_before = 0;  ///< the last frame that is surely not meant; those in between are on either side
  int64_t frame = 0;
  int64_t count = 0;  ///< frames that were lost; negative: that many too many, as where one was written twice
};

/// Drops, by camera and frame, that explain the steps of the pairs whose frames do not belong together, as far as frames bear
/// these out (FrameSteps::Supported). The cause of a step is the one that most pairs share; of two alike, frames that were
/// lost. A step that most pairs of neither camera show is no loss: a camera that moved can look so to one other. None where there would be more than eight: that is no loss of frames.
std::vector<FrameDrop> FindFrameDrops(const FrameOffsets& offsets);

/// "frames with the same number were not taken at the same time: cam_03 lost 5 frames after frame 239"; empty without drops.
std::string ToString(const std::vector<FrameDrop>& drops, const std::vector<std::string>& camera_names);

/// Renumbers the frames; those that may be on either side of a drop are left out.
void ApplyFrameDrops(const std::vector<FrameDrop>& drops, std::vector<Detection>* detections);

/// The camera's own number of a frame that was renumbered.
int64_t FrameBeforeDrops(const std::vector<FrameDrop>& drops, int camera_idx, int64_t frame);

}  // namespace mvstudio::calib
