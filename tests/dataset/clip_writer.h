#pragma once

#include <algorithm>
#include <array>
#include <functional>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/image.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/display.h>
#include <libavutil/opt.h>
}

/// Small videos with chosen time stamps, codecs and faults. Each frame carries its number as a bar code.
namespace mvstudio::testing {

struct ClipOptions {
  std::string codec = "libx264";  ///< libx264, ffv1, mjpeg
  int width = 128, height = 64;
  AVRational time_base{1, 90000};
  int b_frames = 0;
  int gop = 12;
  bool ten_bit = false;
  int clockwise_deg = 0;
  std::array<double, 4> matrix{};  ///< a, b, c, d of the display matrix; zeros: none
  AVRational pixel_aspect{0, 1};
  std::function<uint8_t(int, int)> level;  ///< grey level at (x, y), instead of a number
  bool index_first = true;                 ///< MP4: moov before the frames
  std::string time_code;                   ///< "10:00:00:05"; empty: none
};

constexpr int kCodeBits = 12;

/// Grey levels of frame `code`: 12 bars, white for 1.
inline uint8_t CodeLevel(int code, int x, int width) { return (code >> (x * kCodeBits / width)) & 1 ? 225 : 30; }

/// The number that an image carries.
inline int ReadCode(const Image& image) {
  int code = 0;
  for (int bit = 0; bit < kCodeBits; ++bit) {
    const int x = (2 * bit + 1) * image.width / (2 * kCodeBits);
    code |= (image.Pixel(x, image.height / 2)[0] > 127) << bit;
  }
  return code;
}

class ClipWriter {
 public:
  ClipWriter(const std::string& path, const ClipOptions& options) : options_(options) {
    avformat_alloc_output_context2(&format_, nullptr, nullptr, path.c_str());
    const AVCodec* encoder = avcodec_find_encoder_by_name(options.codec.c_str());
    codec_ = avcodec_alloc_context3(encoder);
    codec_->width = options.width, codec_->height = options.height;
    codec_->time_base = options.time_base;
    codec_->framerate = {30, 1};
    codec_->pix_fmt = options.ten_bit            ? AV_PIX_FMT_YUV420P10LE
                      : options.codec == "mjpeg" ? AV_PIX_FMT_YUVJ420P
                                                 : AV_PIX_FMT_YUV420P;
    codec_->max_b_frames = options.b_frames;
    codec_->gop_size = options.gop;
    codec_->thread_count = 1;
    if (format_->oformat->flags & AVFMT_GLOBALHEADER) codec_->flags |= AV_CODEC_FLAG_GLOBAL_HEADER;
    if (options.codec == "libx264") {
      av_opt_set(codec_->priv_data, "preset", options.b_frames ? "fast" : "ultrafast", 0);
      av_opt_set(codec_->priv_data, "crf", "10", 0);
      av_opt_set(codec_->priv_data, "x264-params", "scenecut=0:b-adapt=0", 0);
    }
    if (options.codec == "ffv1") codec_->level = 3, codec_->slices = 4, av_opt_set(codec_->priv_data, "slicecrc", "1", 0);
    Check(avcodec_open2(codec_, encoder, nullptr));
    stream_ = avformat_new_stream(format_, nullptr);
    avcodec_parameters_from_context(stream_->codecpar, codec_);
    stream_->time_base = options.time_base;
    if (options.clockwise_deg != 0) {
      uint8_t* matrix = av_stream_new_side_data(stream_, AV_PKT_DATA_DISPLAYMATRIX, 9 * sizeof(int32_t));
      av_display_rotation_set(reinterpret_cast<int32_t*>(matrix), options.clockwise_deg);
    }
    if (options.matrix != std::array<double, 4>{}) {
      auto* m = reinterpret_cast<int32_t*>(av_stream_new_side_data(stream_, AV_PKT_DATA_DISPLAYMATRIX, 9 * sizeof(int32_t)));
      std::fill_n(m, 9, 0);
      for (const int i : {0, 1, 2, 3}) m[i + i / 2] = static_cast<int32_t>(options.matrix[static_cast<size_t>(i)] * 65536);
      m[8] = 1 << 30;
    }
    if (options.pixel_aspect.num > 0)
      stream_->sample_aspect_ratio = stream_->codecpar->sample_aspect_ratio = options.pixel_aspect;
    if (!options.time_code.empty()) {
      stream_->avg_frame_rate = {30, 1};
      av_dict_set(&stream_->metadata, "timecode", options.time_code.c_str(), 0);
    }
    Check(avio_open(&format_->pb, path.c_str(), AVIO_FLAG_WRITE));
    AVDictionary* muxer = nullptr;
    if (options.index_first) av_dict_set(&muxer, "movflags", "+faststart", 0);
    Check(avformat_write_header(format_, &muxer));
    av_dict_free(&muxer);
    frame_ = av_frame_alloc();
    packet_ = av_packet_alloc();
    frame_->width = options.width, frame_->height = options.height, frame_->format = codec_->pix_fmt;
    Check(av_frame_get_buffer(frame_, 0));
  }
  ~ClipWriter() {
    Close();
    av_frame_free(&frame_);
    av_packet_free(&packet_);
    avcodec_free_context(&codec_);
    avio_closep(&format_->pb);
    avformat_free_context(format_);
  }

  /// `pts` in units of the time base.
  void Write(int code, int64_t pts) {
    av_frame_make_writable(frame_);
    for (int plane = 0; plane < 3; ++plane) {
      const int shift = plane > 0;
      for (int y = 0; y < options_.height >> shift; ++y) {
        uint8_t* row = frame_->data[plane] + static_cast<ptrdiff_t>(y) * frame_->linesize[plane];
        for (int x = 0; x < options_.width >> shift; ++x) {
          const int level = plane > 0 ? 128 : options_.level ? options_.level(x, y) : CodeLevel(code, x, options_.width);
          if (options_.ten_bit) {
            reinterpret_cast<uint16_t*>(row)[x] = static_cast<uint16_t>(level << 2);
          } else {
            row[x] = static_cast<uint8_t>(level);
          }
        }
      }
    }
    frame_->pts = pts;
    frame_->pict_type = AV_PICTURE_TYPE_NONE;
    Encode(frame_);
  }

  void Close() {
    if (closed_) return;
    closed_ = true;
    Encode(nullptr);
    av_write_trailer(format_);
    avio_flush(format_->pb);
  }

 private:
  static void Check(int code) {
    if (code < 0) throw std::runtime_error("test clip: libav error " + std::to_string(code));
  }
  void Encode(const AVFrame* frame) {
    Check(avcodec_send_frame(codec_, frame));
    while (avcodec_receive_packet(codec_, packet_) >= 0) {
      packet_->duration = 1500;  // less than any step; without one MP4's edit list hides the last frame
      av_packet_rescale_ts(packet_, codec_->time_base, stream_->time_base);
      packet_->stream_index = stream_->index;
      Check(av_interleaved_write_frame(format_, packet_));
    }
  }

  ClipOptions options_;
  AVFormatContext* format_ = nullptr;
  AVCodecContext* codec_ = nullptr;
  AVStream* stream_ = nullptr;
  AVFrame* frame_ = nullptr;
  AVPacket* packet_ = nullptr;
  bool closed_ = false;
};

/// Frame i carries codes[i], or i.
inline void WriteClip(const std::string& path, const std::vector<int64_t>& pts, const ClipOptions& options = {},
                      const std::vector<int>& codes = {}) {
  ClipWriter writer(path, options);
  for (size_t i = 0; i < pts.size(); ++i) writer.Write(codes.empty() ? static_cast<int>(i) : codes[i], pts[i]);
}

/// Where each packet lies in a file: offset, size.
inline std::vector<std::pair<int64_t, int>> PacketPlaces(const std::string& path) {
  std::vector<std::pair<int64_t, int>> places;
  AVFormatContext* format = nullptr;
  if (avformat_open_input(&format, path.c_str(), nullptr, nullptr) < 0) return places;
  AVPacket* packet = av_packet_alloc();
  for (; av_read_frame(format, packet) >= 0; av_packet_unref(packet)) places.emplace_back(packet->pos, packet->size);
  av_packet_free(&packet);
  avformat_close_input(&format);
  return places;
}

/// `count` time stamps `step` apart.
inline std::vector<int64_t> Regular(int count, int64_t step = 3000, int64_t first = 0) {
  std::vector<int64_t> pts;
  for (int i = 0; i < count; ++i) pts.push_back(first + i * step);
  return pts;
}

}  // namespace mvstudio::testing
