#include <algorithm>
#include <cmath>
#include <filesystem>

#include "core/error.h"
#include "dataset/libav_util.h"
#include "dataset/video_io.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/display.h>
#include <libavutil/imgutils.h>
#include <libswscale/swscale.h>
}

namespace mvstudio::dataset {
namespace {

using internal::AvErrorText;

/// Quarter turns clockwise that the container asks for.
int QuarterTurns(const AVStream& stream) {
  const uint8_t* matrix = av_stream_get_side_data(&stream, AV_PKT_DATA_DISPLAYMATRIX, nullptr);
  if (!matrix) return 0;
  const double clockwise_deg = -av_display_rotation_get(reinterpret_cast<const int32_t*>(matrix));
  if (!std::isfinite(clockwise_deg)) return 0;
  return ((static_cast<int>(std::lround(clockwise_deg / 90.0)) % 4) + 4) % 4;
}

Image Turned(const Image& image, int quarter_turns) {
  if (quarter_turns == 0) return image;
  const bool swap = quarter_turns % 2 != 0;
  Image out(swap ? image.height : image.width, swap ? image.width : image.height, image.channels);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const int u = quarter_turns == 1 ? image.height - 1 - y : quarter_turns == 2 ? image.width - 1 - x : y;
      const int v = quarter_turns == 1 ? x : quarter_turns == 2 ? image.height - 1 - y : image.width - 1 - x;
      std::copy_n(image.Pixel(x, y), image.channels, out.Pixel(u, v));
    }
  }
  return out;
}

/// Frames the container promises to show; 0 when it does not say.
int64_t PromisedFrames(AVStream* stream) {
  const int64_t claimed = stream->nb_frames;
  const int64_t indexed = avformat_index_get_entries_count(stream);
  return claimed > 0 && indexed > 0 ? std::min(claimed, indexed) : claimed;
}

/// Duration that Matroska and WebM keep with the stream ("HH:MM:SS.fraction"), seconds; 0 when absent.
double TaggedDuration(const AVStream& stream) {
  const AVDictionaryEntry* tag = av_dict_get(stream.metadata, "DURATION", nullptr, 0);
  int hours = 0, minutes = 0;
  double seconds = 0;
  if (!tag || std::sscanf(tag->value, "%d:%d:%lf", &hours, &minutes, &seconds) != 3) return 0;
  return hours * 3600.0 + minutes * 60.0 + seconds;
}

}  // namespace

struct VideoReader::Impl {
  std::string path;
  VideoInfo info;
  AVFormatContext* format = nullptr;
  AVCodecContext* codec = nullptr;
  AVPacket* packet = nullptr;
  AVFrame* frame = nullptr;
  SwsContext* converter = nullptr;
  AVStream* stream = nullptr;
  int quarter_turns = 0;
  int coded_width = 0, coded_height = 0, pixel_format = -1;
  int64_t promised = 0, discarded = 0, next_idx = 0;
  double time_s = 0;
  bool flushing = false, finished = false;

  explicit Impl(const std::string& p) : path(p) {}
  ~Impl() {
    sws_freeContext(converter);
    av_frame_free(&frame);
    av_packet_free(&packet);
    avcodec_free_context(&codec);
    avformat_close_input(&format);
  }

  [[noreturn]] void Damaged(const std::string& what) const {
    throw FormatError(path, "frame " + std::to_string(next_idx), what + "; the video is damaged or cut short, copy it again");
  }

  void Open();
  void OpenCodec();
  bool Receive();
  void Feed();
  void CheckComplete() const;
  Image Convert();
};

void VideoReader::Impl::Open() {
  internal::SilenceLibav();
  if (!std::filesystem::exists(path)) throw IoError(path, "no such file");
  if (std::filesystem::is_directory(path)) throw IoError(path, "is a folder, a video was expected");
  int code = avformat_open_input(&format, path.c_str(), nullptr, nullptr);
  if (code == AVERROR(EACCES)) throw IoError(path, "cannot open: permission denied");
  if (code < 0)
    throw FormatError(path, "", "is not a video that can be opened (" + AvErrorText(code) + "); empty or cut short?");
  code = avformat_find_stream_info(format, nullptr);
  if (code < 0) throw FormatError(path, "", "cannot read the streams (" + AvErrorText(code) + ")");
  const int idx = av_find_best_stream(format, AVMEDIA_TYPE_VIDEO, -1, -1, nullptr, 0);
  if (idx < 0) throw FormatError(path, "", "holds no video stream");
  stream = format->streams[idx];
  for (unsigned i = 0; i < format->nb_streams; ++i) {
    if (static_cast<int>(i) != idx) format->streams[i]->discard = AVDISCARD_ALL;
  }
  OpenCodec();
  packet = av_packet_alloc();
  frame = av_frame_alloc();
  if (!packet || !frame) throw ResourceError(path + ": out of memory");
}

void VideoReader::Impl::OpenCodec() {
  const AVCodec* decoder = avcodec_find_decoder(stream->codecpar->codec_id);
  if (!decoder) throw FormatError(path, "", std::string("no decoder for ") + avcodec_get_name(stream->codecpar->codec_id));
  codec = avcodec_alloc_context3(decoder);
  if (!codec || avcodec_parameters_to_context(codec, stream->codecpar) < 0) throw ResourceError(path + ": out of memory");
  codec->pkt_timebase = stream->time_base;
  codec->thread_count = 0;
  codec->err_recognition = AV_EF_EXPLODE | AV_EF_CRCCHECK;
  const int code = avcodec_open2(codec, decoder, nullptr);
  if (code < 0)
    throw FormatError(path, "", std::string("cannot start the decoder ") + decoder->name + ": " + AvErrorText(code));
  quarter_turns = QuarterTurns(*stream);
  coded_width = codec->width;
  coded_height = codec->height;
  if (coded_width <= 0 || coded_height <= 0) throw FormatError(path, "", "the video has no picture size; cut short?");
  promised = PromisedFrames(stream);
  const AVRational rate = stream->avg_frame_rate.num > 0 ? stream->avg_frame_rate : stream->r_frame_rate;
  info.frame_rate_hz = rate.num > 0 && rate.den > 0 ? av_q2d(rate) : 0;
  info.width = quarter_turns % 2 ? coded_height : coded_width;
  info.height = quarter_turns % 2 ? coded_width : coded_height;
  info.num_frames = promised;
  info.codec = avcodec_get_name(stream->codecpar->codec_id);
}

/// True when `frame` holds the next picture.
bool VideoReader::Impl::Receive() {
  const int code = avcodec_receive_frame(codec, frame);
  if (code == AVERROR(EAGAIN)) return false;
  if (code == AVERROR_EOF) {
    finished = true;
    return false;
  }
  if (code < 0) Damaged("cannot decode (" + AvErrorText(code) + ")");
  if ((frame->flags & AV_FRAME_FLAG_CORRUPT) || frame->decode_error_flags) Damaged("the picture decodes with errors");
  return true;
}

void VideoReader::Impl::Feed() {
  if (flushing) Damaged("the decoder asks for more after the end");
  int code = av_read_frame(format, packet);
  if (code == AVERROR_EOF) {
    flushing = true;
    if (format->pb && format->pb->error < 0) Damaged("cannot read (" + AvErrorText(format->pb->error) + ")");
    avcodec_send_packet(codec, nullptr);
    return;
  }
  if (code < 0) Damaged("cannot read (" + AvErrorText(code) + ")");
  if (packet->stream_index == stream->index) {
    if (packet->flags & AV_PKT_FLAG_CORRUPT) Damaged("a packet is cut short");
    if (packet->flags & AV_PKT_FLAG_DISCARD) ++discarded;
    code = avcodec_send_packet(codec, packet);
  }
  av_packet_unref(packet);
  if (code < 0) Damaged("cannot decode (" + AvErrorText(code) + ")");
}

void VideoReader::Impl::CheckComplete() const {
  if (promised > 0 && next_idx < promised - discarded) {
    Damaged("the stream ends after " + std::to_string(next_idx) + " of " + std::to_string(promised - discarded) + " frames");
  }
  const double duration_s = TaggedDuration(*stream);
  if (promised <= 0 && duration_s > 0 && info.frame_rate_hz > 0 && time_s + 2.5 / info.frame_rate_hz < duration_s) {
    Damaged("the stream ends at " + std::to_string(time_s) + " s of " + std::to_string(duration_s) + " s");
  }
}

Image VideoReader::Impl::Convert() {
  if (frame->width != coded_width || frame->height != coded_height) {
    throw FormatError(path, "frame " + std::to_string(next_idx),
                      "the picture size changes from " + std::to_string(coded_width) + "x" + std::to_string(coded_height) +
                          " to " + std::to_string(frame->width) + "x" + std::to_string(frame->height) + " in mid-stream");
  }
  if (!converter || pixel_format != frame->format) {
    sws_freeContext(converter);
    converter = internal::MakeToRgbConverter(*frame);
    pixel_format = frame->format;
    if (!converter) throw FormatError(path, "frame " + std::to_string(next_idx), "unsupported pixel format");
  }
  uint8_t* planes[4] = {};
  int strides[4] = {};
  if (av_image_alloc(planes, strides, frame->width, frame->height, AV_PIX_FMT_RGB24, 64) < 0) {
    throw ResourceError(path + ": out of memory");
  }
  sws_scale(converter, frame->data, frame->linesize, 0, frame->height, planes, strides);
  Image image(frame->width, frame->height, 3);
  for (int y = 0; y < image.height; ++y)
    std::copy_n(planes[0] + int64_t{y} * strides[0], size_t{3} * image.width, image.Pixel(0, y));
  av_freep(&planes[0]);
  return Turned(image, quarter_turns);
}

VideoReader::VideoReader(const std::string& path) : impl_(std::make_unique<Impl>(path)) { impl_->Open(); }
VideoReader::~VideoReader() = default;
const VideoInfo& VideoReader::info() const { return impl_->info; }
double VideoReader::time_s() const { return impl_->time_s; }
int64_t VideoReader::frame_idx() const { return impl_->next_idx - 1; }

std::optional<Image> VideoReader::Next() {
  Impl& r = *impl_;
  while (!r.finished) {
    if (!r.Receive()) {
      if (!r.finished) r.Feed();
      continue;
    }
    Image image = r.Convert();
    const int64_t pts = r.frame->best_effort_timestamp;
    const double rate = r.info.frame_rate_hz;
    r.time_s = pts != AV_NOPTS_VALUE ? pts * av_q2d(r.stream->time_base) : rate > 0 ? r.next_idx / rate : 0;
    ++r.next_idx;
    av_frame_unref(r.frame);
    return image;
  }
  r.CheckComplete();
  return std::nullopt;
}

}  // namespace mvstudio::dataset
