#include "synth/recorder.h"

#include "core/disk/files.h"
#include "core/format.h"
#include "dataset/footage/image_io.h"

namespace mvstudio::synth {

Recorder::Recorder(const std::string& stem, const SynthOptions& options) {
  if (options.format == FootageFormat::kPng) {
    path_ = stem;
    MakeFolder(path_);
    return;
  }
  const auto [width, height] = ParseSize(options.size);
  path_ = stem + ".mp4";
  video_ = std::make_unique<dataset::VideoWriter>(path_, width, height, options.fps, options.crf);
}

void Recorder::Write(const Image& rgb) {
  if (video_) {
    video_->Write(rgb);
  } else {
    dataset::WriteImage(rgb, FramePath(path_, next_frame_++));
  }
}

void Recorder::Close() {
  if (video_) video_->Close();
}

std::string FramePath(const std::string& folder, int frame_idx) { return folder + Format("/%08d.png", frame_idx); }

}  // namespace mvstudio::synth
