#pragma once

#include <memory>
#include <string>
#include <vector>

#include "core/image.h"
#include "dataset/footage/video_io.h"
#include "synth/studio.h"

namespace mvstudio::synth {

/// Footage of one camera: CAM.mp4 or the folder CAM/ of numbered PNG files.
class Recorder {
 public:
  /// `stem`: path without extension.
  Recorder(const std::string& stem, const SynthOptions& options);
  void Write(const Image& rgb);
  void Close();
  /// Path of the footage.
  const std::string& path() const { return path_; }

 private:
  std::string path_;
  std::unique_ptr<dataset::VideoWriter> video_;
  int next_frame_ = 0;
};

/// `%08d.png` of a frame below `folder`.
std::string FramePath(const std::string& folder, int frame_idx);

}  // namespace mvstudio::synth
