#pragma once

#include <memory>
#include <optional>
#include <string>

#include "core/image.h"

namespace mvstudio::dataset {

/// The frames of one camera, from a video file, an image folder or a pattern (`left*.jpg`), in order.
class FrameSource {
 public:
  virtual ~FrameSource() = default;
  struct Frame {
    int64_t frame_idx = 0;  ///< videos and folders: position from 0
    std::string label;      ///< file name of an image, "frame 12" for a video: for messages
    Image rgb;
  };
  virtual std::optional<Frame> Next() = 0;
  virtual int64_t num_frames() const = 0;  ///< 0 when unknown
  virtual const std::string& path() const = 0;
};

/// Throws IoError when nothing matches, FormatError when a file is neither an image nor a video.
std::unique_ptr<FrameSource> OpenFrames(const std::string& path_or_pattern);

}  // namespace mvstudio::dataset
