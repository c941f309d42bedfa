#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <map>
#include <set>

#include "core/check.h"
#include "core/error.h"
#include "dataset/footage/image_io.h"
#include "dataset/footage/libav_util.h"
#include "dataset/footage/video_checksum.h"
#include "dataset/footage/video_file.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/imgutils.h>
#include <libswscale/swscale.h>
}

namespace mvstudio::dataset {
namespace {

using internal::AvErrorText;

constexpr size_t kMaxCauses = 20;

struct FreeFrame {
  void operator()(AVFrame* frame) const { av_frame_free(&frame); }
};
using FramePtr = std::unique_ptr<AVFrame, FreeFrame>;

FramePtr NewFrame(const std::string& path) {
  FramePtr frame(av_frame_alloc());
  if (!frame) throw ResourceError(path + ": out of memory");
  return frame;
}

bool IsDamaged(const AVFrame& frame) { return (frame.flags & AV_FRAME_FLAG_CORRUPT) || frame.decode_error_flags; }

}  // namespace

struct VideoReader::Impl {
  std::string path;
  VideoOptions options;
  std::unique_ptr<internal::VideoFile> file;
  VideoInfo info;
  VideoDamage damage;
  AVCodecContext* codec = nullptr;
  SwsContext *converter = nullptr, *reducer = nullptr;
  FramePtr frame;  ///< the current one
  uint8_t* planes[4] = {};
  int strides[4] = {};
  int coded_width = 0, coded_height = 0;
  std::array<int, 5> converts = {-1};  ///< what `converter` was made for
  int64_t discarded = 0, frame_idx = -1;
  double time_s = 0;
  bool flushing = false, finished = false;
  std::optional<internal::SliceChecksums> checksums;

  // Only with keep_undamaged:
  std::multimap<int64_t, int64_t> idx_of_pts;  ///< frames not yet returned
  int64_t num_frames = 0;                      ///< that there should be
  int64_t last_numbered_pts = INT64_MAX;       ///< frames shown later may have others before them that were cut off
  std::vector<bool> returned;
  std::deque<FramePtr> ready;                                  ///< sound frames saved before the decoder was started anew
  std::map<int64_t, int64_t> keys;                             ///< key frames sent: packet -> pts
  int64_t next_packet = 0, resume_packet = 0, resume_pts = 0;  ///< frames from packets on `resume_packet` start at `resume_pts`
  bool skip_to_key = false;

  Impl(const std::string& p, const VideoOptions& o) : path(p), options(o) {}
  ~Impl() {
    sws_freeContext(converter);
    sws_freeContext(reducer);
    av_freep(&planes[0]);
    avcodec_free_context(&codec);
  }

  [[noreturn]] void Damaged(const std::string& what) const {
    throw FormatError(path, "frame " + std::to_string(frame_idx + 1),
                      what + "; the video is damaged or cut short, copy it again");
  }
  void Open();
  void OpenCodec();
  void ScanAhead();
  bool Receive();
  void Feed();
  void Fail(const std::string& what, int64_t packet);
  bool Rescue(int64_t packet, int64_t first_key);
  bool IsWhole(const AVFrame& f) const;
  void Enter();
  void CheckComplete() const;
  void ListMissing();
  void CheckTurn() const;
  Image Convert();
};

void VideoReader::Impl::Open() {
  if (options.keep_undamaged) ScanAhead();
  file = std::make_unique<internal::VideoFile>(path, options.max_pixels);
  info = file->info();
  OpenCodec();
  frame = NewFrame(path);
}

void VideoReader::Impl::OpenCodec() {
  AVStream* stream = file->stream();
  const AVCodec* decoder = avcodec_find_decoder(stream->codecpar->codec_id);
  if (!decoder) throw FormatError(path, "", std::string("no decoder for ") + avcodec_get_name(stream->codecpar->codec_id));
  codec = avcodec_alloc_context3(decoder);
  if (!codec || avcodec_parameters_to_context(codec, stream->codecpar) < 0) throw ResourceError(path + ": out of memory");
  codec->pkt_timebase = stream->time_base;
  codec->thread_count = 0;
  if (options.keep_undamaged) codec->thread_type = FF_THREAD_SLICE;  // an error belongs to the packet that was sent last
  codec->err_recognition = AV_EF_EXPLODE | AV_EF_CRCCHECK;
  codec->max_pixels = options.max_pixels > 0 ? options.max_pixels : MaxPixels();
  const int code = avcodec_open2(codec, decoder, nullptr);
  if (code < 0) {
    throw FormatError(path, "", std::string("cannot start the decoder ") + decoder->name + ": " + AvErrorText(code));
  }
  if (codec->codec_id == AV_CODEC_ID_FFV1) checksums.emplace();
  coded_width = stream->codecpar->width;
  coded_height = stream->codecpar->height;
}

/// Numbers the frames by their times before any is decoded, so that those after a gap keep theirs.
void VideoReader::Impl::ScanAhead() {
  internal::VideoFile first(path, options.max_pixels);
  const internal::PacketScan scan = internal::ScanPackets(&first);
  for (size_t i = 0; i < scan.pts.size(); ++i) {
    if (scan.pts[i] != AV_NOPTS_VALUE) idx_of_pts.emplace(scan.pts[i], static_cast<int64_t>(i));
  }
  num_frames = std::max(static_cast<int64_t>(scan.pts.size()), first.promised() - scan.discarded);
  const bool ends_early = scan.ends_in_packet || static_cast<int64_t>(scan.pts.size()) < num_frames || first.io_error() < 0;
  const bool reordered = first.stream()->codecpar->video_delay > 0 && scan.last_dts != INT64_MIN;
  if (ends_early && reordered) last_numbered_pts = scan.last_dts;
  const bool hidden_frames = first.stream()->codecpar->codec_id == AV_CODEC_ID_VP8;
  if (hidden_frames) num_frames = 0;
  returned.assign(static_cast<size_t>(num_frames), false);
  if (!scan.cut_short.empty()) damage.causes.push_back(scan.cut_short);
}

/// Whether a decoded frame is made of sound packets only, and its number is certain.
bool VideoReader::Impl::IsWhole(const AVFrame& f) const {
  if (f.pts != AV_NOPTS_VALUE && f.pts > last_numbered_pts) return false;
  return f.reordered_opaque < resume_packet || f.pts == AV_NOPTS_VALUE || f.pts >= resume_pts;
}

/// True when `frame` holds the next image.
bool VideoReader::Impl::Receive() {
  if (!ready.empty()) {
    frame = std::move(ready.front());
    ready.pop_front();
    return true;
  }
  if (flushing && finished) return false;
  const int code = avcodec_receive_frame(codec, frame.get());
  if (code == AVERROR(EAGAIN)) return false;
  if (code == AVERROR_EOF) {
    finished = true;
    return false;
  }
  if (code == AVERROR(ENOMEM)) throw ResourceError(path + ": out of memory");
  if (code < 0) {
    Fail("cannot decode (" + AvErrorText(code) + ")", next_packet - 1);
    return false;
  }
  if (IsDamaged(*frame)) {
    Fail("the image decodes with errors", frame->reordered_opaque);
    return false;
  }
  return !options.keep_undamaged || IsWhole(*frame) || Receive();
}

/// Saves what the decoder still holds of packets before `packet`, or from the first key frame after it on.
bool VideoReader::Impl::Rescue(int64_t packet, int64_t first_key) {
  avcodec_send_packet(codec, nullptr);
  while (true) {
    FramePtr held = NewFrame(path);
    const int code = avcodec_receive_frame(codec, held.get());
    if (code == AVERROR_EOF || code == AVERROR(EAGAIN)) return true;
    if (code < 0) continue;
    const bool before = held->reordered_opaque < packet && IsWhole(*held);
    const bool after = first_key >= 0 && held->reordered_opaque >= first_key && held->pts >= keys[first_key];
    if ((before || after) && !IsDamaged(*held)) ready.push_back(std::move(held));
  }
}

/// Damage found in `packet`.
void VideoReader::Impl::Fail(const std::string& what, int64_t packet) {
  if (!options.keep_undamaged) Damaged(what);
  if (damage.causes.size() < kMaxCauses) {
    damage.causes.push_back("packet " + std::to_string(packet) + ": " + what);
  }
  const auto key = keys.upper_bound(packet);
  Rescue(packet, key == keys.end() ? -1 : key->first);
  avcodec_flush_buffers(codec);
  if (flushing) finished = true;
  skip_to_key = true;
}

void VideoReader::Impl::Feed() {
  if (flushing) {
    if (options.keep_undamaged) finished = true;
    if (finished) return;
    Damaged("the decoder asks for more after the end");
  }
  int code = file->Read();
  if (code < 0) {
    const int error = code != AVERROR_EOF ? code : file->io_error();
    if (error < 0 && !options.keep_undamaged) Damaged("cannot read (" + AvErrorText(error) + ")");
    flushing = true;
    avcodec_send_packet(codec, nullptr);
    return;
  }
  AVPacket* packet = file->packet();
  codec->reordered_opaque = next_packet++;
  if (packet->flags & AV_PKT_FLAG_CORRUPT) return Fail("a packet is cut short", next_packet - 1);
  if (checksums && checksums->IsDamaged(*packet)) return Fail("a slice's checksum does not fit", next_packet - 1);
  if (packet->flags & AV_PKT_FLAG_DISCARD) ++discarded;
  const bool key = packet->flags & AV_PKT_FLAG_KEY;
  if (skip_to_key && !key) return;
  if (skip_to_key) resume_packet = next_packet - 1, resume_pts = packet->pts;
  if (key && options.keep_undamaged) keys[next_packet - 1] = packet->pts;
  skip_to_key = false;
  code = avcodec_send_packet(codec, packet);
  if (code == AVERROR(ENOMEM)) throw ResourceError(path + ": out of memory");
  if (code < 0) Fail("cannot decode (" + AvErrorText(code) + ")", next_packet - 1);
}

/// Gives the current frame its number and time.
void VideoReader::Impl::Enter() {
  const int64_t best = frame->pts != AV_NOPTS_VALUE ? frame->pts : frame->best_effort_timestamp;
  ++frame_idx;
  if (options.keep_undamaged) {
    const auto found = idx_of_pts.find(frame->pts);
    if (found != idx_of_pts.end()) {
      frame_idx = found->second;
      idx_of_pts.erase(found);
    }
    if (frame_idx < num_frames) returned[static_cast<size_t>(frame_idx)] = true;
  }
  const double rate = info.frame_rate_hz;
  time_s = best != AV_NOPTS_VALUE ? file->Seconds(best) : rate > 0 ? static_cast<double>(frame_idx) / rate : 0;
  if (frame->width != coded_width || frame->height != coded_height) {
    throw FormatError(path, "frame " + std::to_string(frame_idx),
                      "the image size changes from " + std::to_string(coded_width) + "x" + std::to_string(coded_height) +
                          " to " + std::to_string(frame->width) + "x" + std::to_string(frame->height) + " in mid-stream");
  }
}

void VideoReader::Impl::CheckComplete() const {
  const int64_t there = frame_idx + 1, due = file->promised() - discarded;
  if (file->promised() > 0 && there < due) {
    Damaged("the stream ends after " + std::to_string(there) + " of " + std::to_string(due) + " frames");
  }
  const double duration_s = file->tagged_duration_s();
  if (file->promised() <= 0 && internal::EndsEarly(time_s, there, info.frame_rate_hz, duration_s)) {
    Damaged("the stream ends at " + std::to_string(time_s) + " s of " + std::to_string(duration_s) + " s");
  }
}

void VideoReader::Impl::ListMissing() {
  for (int64_t i = 0; i < num_frames; ++i) {
    if (returned[static_cast<size_t>(i)]) continue;
    if (!damage.missing.empty() && damage.missing.back().second == i - 1) {
      damage.missing.back().second = i;
    } else {
      damage.missing.emplace_back(i, i);
    }
    ++damage.num_missing;
  }
  const double duration_s = file->tagged_duration_s();
  if (file->promised() <= 0 && internal::EndsEarly(time_s, frame_idx + 1, info.frame_rate_hz, duration_s)) {
    damage.causes.push_back("the stream ends at " + std::to_string(time_s) + " s of " + std::to_string(duration_s) + " s");
  } else if (damage.num_missing > 0 && damage.causes.empty()) {
    damage.causes.push_back("the stream ends early");
  }
}

/// A turn that the frame asks for (H.264's SEI, EXIF in Motion JPEG) and the container does not.
void VideoReader::Impl::CheckTurn() const {
  const AVFrameSideData* const matrix = av_frame_get_side_data(frame.get(), AV_FRAME_DATA_DISPLAYMATRIX);
  if (!matrix) return;
  const ImageTurn turn = internal::TurnOfMatrix(reinterpret_cast<const int32_t*>(matrix->data), path);
  if (turn == info.turn) return;
  throw FormatError(path, "frame " + std::to_string(frame_idx),
                    "asks for " + ToText(turn) + ", its container for " + (info.turn.any() ? ToText(info.turn) : "none") +
                        "; write the video anew as it is to be shown");
}

Image VideoReader::Impl::Convert() {
  CheckTurn();
  const std::array<int, 5> kind = {frame->format, frame->color_range, frame->colorspace, frame->chroma_location, 0};
  if (!converter || converts != kind) {
    sws_freeContext(converter);
    converter = internal::MakeToRgbConverter(*frame);
    converts = kind;
    if (!converter) throw FormatError(path, "frame " + std::to_string(frame_idx), "unsupported pixel format");
  }
  if (!planes[0] && av_image_alloc(planes, strides, frame->width, frame->height, AV_PIX_FMT_RGB24, 64) < 0) {
    throw ResourceError(path + ": out of memory");
  }
  sws_scale(converter, frame->data, frame->linesize, 0, frame->height, planes, strides);
  Image image(frame->width, frame->height, 3);
  for (int y = 0; y < image.height; ++y)
    std::copy_n(planes[0] + int64_t{y} * strides[0], size_t{3} * image.width, image.Pixel(0, y));
  return Rotated(std::move(image), info.turn);
}

VideoReader::VideoReader(const std::string& path, const VideoOptions& options) : impl_(std::make_unique<Impl>(path, options)) {
  impl_->Open();
}
VideoReader::~VideoReader() = default;
const VideoInfo& VideoReader::info() const { return impl_->info; }
double VideoReader::time_s() const { return impl_->time_s; }
int64_t VideoReader::frame_idx() const { return impl_->frame_idx; }
const VideoDamage& VideoReader::damage() const { return impl_->damage; }

bool VideoReader::Advance() {
  Impl& r = *impl_;
  if (!r.frame) return false;
  while (!r.finished || !r.ready.empty()) {
    if (r.Receive()) {
      r.Enter();
      return true;
    }
    if (!r.finished && r.ready.empty()) r.Feed();
  }
  if (r.options.keep_undamaged) {
    r.ListMissing();
  } else {
    r.CheckComplete();
  }
  r.frame.reset();
  return false;
}

Image VideoReader::FullImage() {
  MVS_CHECK(impl_->frame && impl_->frame_idx >= 0, impl_->path << ": no frame was decoded");
  return impl_->Convert();
}

Image VideoReader::Thumbnail(int max_side) {
  Impl& r = *impl_;
  MVS_CHECK(r.frame && r.frame_idx >= 0 && max_side > 0, r.path << ": no frame was decoded");
  const int64_t longer = std::max(r.frame->width, r.frame->height), side = std::min<int64_t>(max_side, longer);
  const auto reduced = [&](int size) { return static_cast<int>(std::max<int64_t>(size * side / longer, 1)); };
  const int width = reduced(r.frame->width), height = reduced(r.frame->height);
  r.reducer = sws_getCachedContext(r.reducer, r.frame->width, r.frame->height, static_cast<AVPixelFormat>(r.frame->format),
                                   width, height, AV_PIX_FMT_GRAY8, SWS_AREA, nullptr, nullptr, nullptr);
  const int stride = (width + 63) / 64 * 64;
  std::vector<uint8_t> rows(static_cast<size_t>(stride) * static_cast<size_t>(height) + 64);
  if (!r.reducer) throw FormatError(r.path, "frame " + std::to_string(r.frame_idx), "unsupported pixel format");
  uint8_t* target[4] = {rows.data()};
  const int target_strides[4] = {stride};
  sws_scale(r.reducer, r.frame->data, r.frame->linesize, 0, r.frame->height, target, target_strides);
  Image image(width, height, 1);
  for (int y = 0; y < height; ++y) std::copy_n(rows.data() + size_t(y) * size_t(stride), size_t(width), image.Pixel(0, y));
  return image;
}

std::optional<Image> VideoReader::Next() {
  if (!Advance()) return std::nullopt;
  return FullImage();
}

}  // namespace mvstudio::dataset
