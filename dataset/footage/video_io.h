#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/image.h"
#include "dataset/footage/image_turn.h"

namespace mvstudio::dataset {

struct VideoInfo {
  int width = 0, height = 0;  ///< as decoded, after rotation metadata was applied
  double frame_rate_hz = 0;   ///< average, from the container
  int64_t num_frames = 0;     ///< stated by the container; 0 when unknown
  std::string codec;
  std::string pixel_format;  ///< libav's name, "yuv420p10le"
  int bits = 8;              ///< per colour sample
  ImageTurn turn;            ///< that the container asks for; FullImage() applies it
  double pixel_aspect = 1;   ///< width to height of a pixel, by the metadata; not applied
  bool interlaced = false;   ///< by the container; a frame then shows two moments
  /// Time of day of the first frame, seconds, by the file's time code (SMPTE ST 12), which counts whole frames.
  std::optional<double> time_code_s;
};

struct VideoOptions {
  /// Continue after damage. Frames that do not decode cleanly are skipped, with all that depend on them until the next key
  /// frame, and are listed in damage(). Frames keep the numbers they have in the whole video.
  bool keep_undamaged = false;
  int64_t max_pixels = 0;  ///< per frame; larger ones are refused before memory is allocated; 0: MaxPixels()
};

/// What is missing from a video; known when it was read to its end.
struct VideoDamage {
  int64_t num_missing = 0;                           ///< frames that should exist and were not returned
  std::vector<std::pair<int64_t, int64_t>> missing;  ///< their numbers, as ranges (first, last)
  std::vector<std::string> causes;                   ///< one line each, at most 20
  bool any() const { return num_missing > 0 || !causes.empty(); }
};

/// Decodes a video file from its first frame to its last (libav). Frames are numbered by the order of their presentation
/// times. Not thread-safe; use one reader per thread.
class VideoReader {
 public:
  /// Throws IoError / FormatError with the path and, for damaged streams, the frame number.
  explicit VideoReader(const std::string& path, const VideoOptions& options = {});
  ~VideoReader();
  const VideoInfo& info() const;
  /// Next frame in presentation order as RGB, empty at the end. Throws FormatError naming the frame when the stream is
  /// damaged or ends before the stated number of frames, unless `keep_undamaged`. Also throws when the image size changes.
  std::optional<Image> Next();
  /// Next in two steps, when not every image is needed: decodes a frame (false at the end), then converts it to an image.
  bool Advance();
  Image FullImage();
  /// Grey image of the current frame, reduced by averaging so that its longer side is `max_side`; not rotated. Fast.
  Image Thumbnail(int max_side);
  /// Presentation time of the last frame returned, seconds, as in the file (edit lists applied). For frames without a time
  /// stamp it follows from their number and the frame rate.
  double time_s() const;
  /// Number of the last frame returned, from 0.
  int64_t frame_idx() const;
  const VideoDamage& damage() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Presentation times of a video's frames, without decoding, in display order.
struct VideoTimes {
  std::vector<double> time_s;         ///< NaN where the file gives none
  int64_t promised = 0;               ///< number of frames stated by the container; 0: unknown
  std::string cut_short;              ///< why reading stopped early; empty: it did not
  std::optional<double> time_code_s;  ///< as in VideoInfo
};
/// Throws like VideoReader's constructor.
VideoTimes ReadVideoTimes(const std::string& path);

/// Writes H.264 in MP4 (libav, libx264). The file appears under its name only on Close().
class VideoWriter {
 public:
  /// `crf`: 0 best … 51 worst. `full_chroma` keeps a colour sample for every pixel (yuv444p; some players refuse it);
  /// otherwise the sizes must be even. BT.709, limited range, tagged as such.
  VideoWriter(const std::string& path, int width, int height, double frame_rate_hz, int crf = 16, bool full_chroma = false);
  ~VideoWriter();
  void Write(const Image& rgb);
  void Close();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace mvstudio::dataset
