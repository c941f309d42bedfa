// Private: libav's containers, for video_reader.cc.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "dataset/footage/video_io.h"

struct AVFormatContext;
struct AVPacket;
struct AVStream;

/// An open container.
namespace mvstudio::dataset::internal {

class VideoFile {
 public:
  VideoFile(const std::string& path, int64_t max_pixels);
  ~VideoFile();
  VideoFile(const VideoFile&) = delete;
  VideoFile& operator=(const VideoFile&) = delete;

  /// Reads the next packet of the video stream; returns 0, AVERROR_EOF or another error of libav. The packet is valid
  /// until the next call.
  int Read();

  const std::string& path() const { return path_; }
  AVStream* stream() const { return stream_; }
  AVPacket* packet() const { return packet_; }
  /// Number of frames stated by the container, before edit lists; 0 when unknown.
  int64_t promised() const;
  /// Duration that Matroska and WebM store with the stream, seconds; 0 when absent.
  double tagged_duration_s() const;
  VideoInfo info() const;
  /// Of the video stream, the container or a stream of time codes; empty: none, or one that is not valid.
  std::optional<double> time_code_s() const;
  double Seconds(int64_t pts) const;  ///< NaN for AV_NOPTS_VALUE
  /// I/O error at the end of the file; 0: none.
  int io_error() const;

 private:
  void Open(int64_t max_pixels);
  void CheckSize(int64_t max_pixels) const;
  std::string path_;
  AVFormatContext* format_ = nullptr;
  AVStream* stream_ = nullptr;
  AVPacket* packet_ = nullptr;
};

/// The turn of a display matrix [a b u; c d v; x y w] (ISO 14496-12), which shows (x, y) at (a x + c y, b x + d y). Throws
/// FormatError unless it is made of quarter turns, a mirror and a scale.
ImageTurn TurnOfMatrix(const int32_t* m, const std::string& path);

/// Result of a first pass over the packets.
struct PacketScan {
  std::vector<int64_t> pts;      ///< of the frames to display, in display order; AV_NOPTS_VALUE: none
  int64_t discarded = 0;         ///< packets that an edit list hides
  std::string cut_short;         ///< why reading stopped early; empty: it did not
  bool ends_in_packet = false;   ///< the last packet is truncated
  int64_t last_dts = INT64_MIN;  ///< of the packets; a missing frame at the end is displayed after this
};
PacketScan ScanPackets(VideoFile* file);

/// Whether a stream whose last frame is at `last_s` ends more than two usual steps before `duration_s`.
bool EndsEarly(double last_s, int64_t num_frames, double rate_hz, double duration_s);

}  // namespace mvstudio::dataset::internal
