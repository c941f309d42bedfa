#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "dataset/footage/video_io.h"

struct AVFormatContext;
struct AVPacket;
struct AVStream;

/// An open container; not part of the module's public face.
namespace mvstudio::dataset::internal {

class VideoFile {
 public:
  VideoFile(const std::string& path, int64_t max_pixels);
  ~VideoFile();
  VideoFile(const VideoFile&) = delete;
  VideoFile& operator=(const VideoFile&) = delete;

  /// The next packet of the video stream; 0, AVERROR_EOF or another error of libav. The packet stays until the next call.
  int Read();

  const std::string& path() const { return path_; }
  AVStream* stream() const { return stream_; }
  AVPacket* packet() const { return packet_; }
  /// Frames the container promises to show before edit lists; 0 when it does not say.
  int64_t promised() const;
  /// Duration that Matroska and WebM keep with the stream, seconds; 0 when absent.
  double tagged_duration_s() const;
  VideoInfo info() const;
  double Seconds(int64_t pts) const;  ///< NaN for AV_NOPTS_VALUE
  /// Error of the file itself at its end; 0: none.
  int io_error() const;

 private:
  void Open(int64_t max_pixels);
  void CheckSize(int64_t max_pixels) const;
  std::string path_;
  AVFormatContext* format_ = nullptr;
  AVStream* stream_ = nullptr;
  AVPacket* packet_ = nullptr;
};

/// The checksums of FFV1, version 3 and later: libav's decoder only logs that they do not fit.
class SliceChecksums {
 public:
  bool IsDamaged(const AVPacket& packet);

 private:
  bool present_ = false;  ///< a packet before had them
};

/// What a first pass over the packets tells.
struct PacketScan {
  std::vector<int64_t> pts;      ///< of the frames to show, in the order in which they are shown; AV_NOPTS_VALUE: none
  int64_t discarded = 0;         ///< packets that an edit list hides
  std::string cut_short;         ///< why reading stopped early; empty: it did not
  bool ends_in_packet = false;   ///< the last packet is cut short
  int64_t last_dts = INT64_MIN;  ///< of the packets; one that is missing at the end is shown after this
};
PacketScan ScanPackets(VideoFile* file);

/// Whether a stream whose last frame is at `last_s` ends before `duration_s` by more than two usual steps.
bool EndsEarly(double last_s, int64_t num_frames, double rate_hz, double duration_s);

}  // namespace mvstudio::dataset::internal
