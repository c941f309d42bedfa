#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "core/image.h"

namespace mvstudio::dataset {

struct VideoInfo {
  int width = 0, height = 0;  ///< as decoded, after rotation metadata was applied
  double frame_rate_hz = 0;   ///< average, from the container
  int64_t num_frames = 0;     ///< as the container claims; 0 when it does not say
  std::string codec;
};

/// Decodes a video file from its first frame to its last (libav). Not thread-safe; one reader a thread.
class VideoReader {
 public:
  /// Throws IoError / FormatError with the path and, for damaged streams, the frame number.
  explicit VideoReader(const std::string& path);
  ~VideoReader();
  const VideoInfo& info() const;
  /// Next frame in presentation order as RGB, nothing at the end. Throws FormatError naming the frame when the stream is
  /// damaged or ends before the frames its container promises.
  std::optional<Image> Next();
  /// Presentation time of the last frame returned, seconds.
  double time_s() const;
  /// Index of the last frame returned, from 0.
  int64_t frame_idx() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Writes H.264 in MP4 (libav, libx264). The file appears under its name on Close() only.
class VideoWriter {
 public:
  /// `crf`: 0 best … 51 worst. `full_chroma` keeps a colour sample for every pixel (yuv444p; some players refuse it), otherwise
  /// the sizes must be even. BT.709, limited range, tagged as such.
  VideoWriter(const std::string& path, int width, int height, double frame_rate_hz, int crf = 16, bool full_chroma = false);
  ~VideoWriter();
  void Write(const Image& rgb);
  void Close();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace mvstudio::dataset
