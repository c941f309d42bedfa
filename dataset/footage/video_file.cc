#include "dataset/footage/video_file.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <queue>

#include "core/disk/paths.h"
#include "core/error.h"
#include "core/format.h"
#include "dataset/footage/image_io.h"
#include "dataset/footage/libav_util.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/avstring.h>
#include <libavutil/display.h>
#include <libavutil/pixdesc.h>
#include <libavutil/timecode.h>
}

namespace mvstudio::dataset {
namespace internal {
namespace {

/// Refuses a matrix that is more than quarter turns, a mirror and a scale of pixels.
[[noreturn]] void RefuseMatrix(const int32_t* m, const std::string& path) {
  const double angle_deg = -av_display_rotation_get(m);
  throw FormatError(path, "display matrix",
                    (std::isfinite(angle_deg) ? "asks for a turn of " + Format("%.3g", angle_deg) + " degrees or a shear"
                                              : std::string("is singular")) +
                        "; only quarter turns and mirrors are applied: write the video anew as it is to be shown");
}

ImageTurn TurnOf(const AVStream& stream, const std::string& path) {
  const uint8_t* matrix = av_stream_get_side_data(&stream, AV_PKT_DATA_DISPLAYMATRIX, nullptr);
  return matrix ? TurnOfMatrix(reinterpret_cast<const int32_t*>(matrix), path) : ImageTurn{};
}

double PixelAspect(const AVStream& stream) {
  for (const AVRational& aspect : {stream.sample_aspect_ratio, stream.codecpar->sample_aspect_ratio}) {
    if (aspect.num > 0 && aspect.den > 0) return av_q2d(aspect);
  }
  return 1;
}

/// What cameras, recorders and editors write: each is one file that names no other. Left out are playlists (hls, dash, concat),
/// descriptions of streams (sdp, rtsp) and patterns of images (image2), whose parts may lie anywhere.
constexpr char kContainers[] =
    "mov,matroska,avi,mpegts,mpeg,mpegvideo,m4v,h264,hevc,mjpeg,ogg,asf,mxf,flv,dv,ivf,nut,gxf,wtv,obu,yuv4mpegpipe";

/// Options of libav, which takes out those it knows.
class Options {
 public:
  Options() = default;
  ~Options() { av_dict_free(&dictionary_); }
  Options(const Options&) = delete;
  Options& operator=(const Options&) = delete;
  void Set(const char* name, const char* value) { av_dict_set(&dictionary_, name, value, 0); }
  AVDictionary** get() { return &dictionary_; }

 private:
  AVDictionary* dictionary_ = nullptr;
};

std::string Url(const std::string& path) { return "file:" + path; }

/// Names of the container that libav takes the file for, as in "mov,mp4,m4a"; empty when it knows none.
std::string ContainerOf(const std::string& path) {
  Options options;
  options.Set("protocol_whitelist", "file");
  AVIOContext* bytes = nullptr;
  if (avio_open2(&bytes, Url(path).c_str(), AVIO_FLAG_READ, nullptr, options.get()) < 0) return "";
  const AVInputFormat* format = nullptr;
  const int score = av_probe_input_buffer2(bytes, &format, Url(path).c_str(), nullptr, 0, 0);
  avio_closep(&bytes);
  return score >= 0 && format ? format->name : "";
}

[[noreturn]] void RefuseToOpen(const std::string& path, int code) {
  if (code == AVERROR(EACCES)) throw IoError(path, "cannot open: permission denied");
  const std::string container = ContainerOf(path);
  if (!container.empty() && av_match_list(container.c_str(), kContainers, ',') <= 0) {
    throw FormatError(path, "",
                      "is of the kind '" + container +
                          "', which is not read as a video: playlists and the like name other files; give the video itself");
  }
  throw FormatError(path, "", "is not a video that can be opened (" + AvErrorText(code) + "); empty or cut short?");
}

/// Finds out the streams' parameters; decoders that it starts refuse larger frames too.
int FindStreamInfo(AVFormatContext* format, int64_t max_pixels) {
  std::vector<AVDictionary*> options(format->nb_streams, nullptr);
  for (AVDictionary*& o : options) av_dict_set_int(&o, "max_pixels", std::min<int64_t>(max_pixels, INT32_MAX), 0);
  const unsigned count = format->nb_streams;
  const int code = avformat_find_stream_info(format, options.data());
  for (unsigned i = 0; i < count; ++i) av_dict_free(&options[i]);
  return code;
}

bool AllSame(const std::vector<int64_t>& times) {
  return times.size() > 1 && std::adjacent_find(times.begin(), times.end(), std::not_equal_to<>()) == times.end();
}

constexpr char kOneTime[] =
    "frames all have one time stamp, so that none has its time; write the video again at its frame rate";

/// Clocks of MP4 and QuickTime that cannot be: libav reads a time scale of 0 as 1.
void CheckClock(const std::string& path, AVFormatContext* format, AVStream* stream) {
  constexpr double kLongestFrameS = 60;
  if (av_match_name("mov", format->iformat->name) <= 0) return;
  std::vector<int64_t> times;
  for (int i = 0; i < avformat_index_get_entries_count(stream); ++i)
    times.push_back(avformat_index_get_entry(stream, i)->timestamp);
  if (AllSame(times)) throw FormatError(path, "", "its " + std::to_string(times.size()) + " " + kOneTime);
  const AVRational base = stream->time_base, rate = stream->avg_frame_rate;
  const double frame_s = rate.num > 0 ? rate.den / static_cast<double>(rate.num) : 0;
  if (base.num == base.den && frame_s > kLongestFrameS)
    throw FormatError(path, "mdhd",
                      "its time scale is 0 or damaged: a frame would last " + Format("%.6g", frame_s) +
                          " s; write the video again at its frame rate");
}

}  // namespace

ImageTurn TurnOfMatrix(const int32_t* m, const std::string& path) {
  const double a = m[0], b = m[1], c = m[3], d = m[4];
  if (a == 0 && b == 0 && c == 0 && d == 0) return {};  // writers that leave it empty
  const double small = 1e-3 * std::max({std::abs(a), std::abs(b), std::abs(c), std::abs(d)});
  const auto zero = [&](double value) { return std::abs(value) <= small; };
  const bool straight = zero(b) && zero(c) && !zero(a) && !zero(d), crossed = zero(a) && zero(d) && !zero(b) && !zero(c);
  if ((!straight && !crossed) || m[2] != 0 || m[5] != 0) RefuseMatrix(m, path);
  ImageTurn turn;
  turn.mirrored = a * d - b * c < 0;
  const double right = turn.mirrored ? -1 : 1;  // where the image's right goes once it is mirrored
  turn.quarter_turns_clockwise = straight ? (a * right > 0 ? 0 : 2) : (b * right > 0 ? 1 : 3);
  return turn;
}

VideoFile::VideoFile(const std::string& path, int64_t max_pixels) : path_(path) {
  try {
    Open(max_pixels > 0 ? max_pixels : MaxPixels());
  } catch (...) {
    avformat_close_input(&format_);
    throw;
  }
}

VideoFile::~VideoFile() {
  av_packet_free(&packet_);
  avformat_close_input(&format_);
}

void VideoFile::CheckSize(int64_t max_pixels) const {
  for (unsigned i = 0; i < format_->nb_streams; ++i) {
    const AVCodecParameters* p = format_->streams[i]->codecpar;
    if (p->codec_type != AVMEDIA_TYPE_VIDEO || int64_t{p->width} * p->height <= max_pixels) continue;
    throw FormatError(path_, "header",
                      "declares frames of " + std::to_string(p->width) + "x" + std::to_string(p->height) +
                          " pixels, more than the " + std::to_string(max_pixels >> 20) +
                          " Mi that are allowed; if it is sound, set MVSTUDIO_MAX_MEGAPIXELS");
  }
}

void VideoFile::Open(int64_t max_pixels) {
  SilenceLibav();
  RequireRegularFile(path_);
  Options options;
  options.Set("protocol_whitelist", "file");
  options.Set("format_whitelist", kContainers);
  options.Set("enable_drefs", "0");  // QuickTime's tracks in other files
  int code = avformat_open_input(&format_, Url(path_).c_str(), nullptr, options.get());
  if (code < 0) RefuseToOpen(path_, code);
  CheckSize(max_pixels);
  code = FindStreamInfo(format_, max_pixels);
  if (code < 0) throw FormatError(path_, "", "cannot read the streams (" + AvErrorText(code) + ")");
  CheckSize(max_pixels);
  const int idx = av_find_best_stream(format_, AVMEDIA_TYPE_VIDEO, -1, -1, nullptr, 0);
  if (idx < 0) throw FormatError(path_, "", "holds no video stream");
  stream_ = format_->streams[idx];
  for (unsigned i = 0; i < format_->nb_streams; ++i) {
    if (static_cast<int>(i) != idx) format_->streams[i]->discard = AVDISCARD_ALL;
  }
  if (stream_->codecpar->width <= 0 || stream_->codecpar->height <= 0) {
    throw FormatError(path_, "", "the video has no image size; cut short?");
  }
  CheckClock(path_, format_, stream_);
  packet_ = av_packet_alloc();
  if (!packet_) throw ResourceError(path_ + ": out of memory");
}

int VideoFile::Read() {
  while (true) {
    av_packet_unref(packet_);
    const int code = av_read_frame(format_, packet_);
    if (code < 0 || packet_->stream_index == stream_->index) return std::min(code, 0);
  }
}

int64_t VideoFile::promised() const {
  const int64_t claimed = stream_->nb_frames;
  const int64_t indexed = avformat_index_get_entries_count(stream_);
  return claimed > 0 && indexed > 0 ? std::min(claimed, indexed) : claimed;
}

double VideoFile::tagged_duration_s() const {
  const AVDictionaryEntry* tag = av_dict_get(stream_->metadata, "DURATION", nullptr, 0);
  int hours = 0, minutes = 0;
  double seconds = 0;
  if (!tag || std::sscanf(tag->value, "%d:%d:%lf", &hours, &minutes, &seconds) != 3) return 0;
  return hours * 3600.0 + minutes * 60.0 + seconds;
}

VideoInfo VideoFile::info() const {
  const AVCodecParameters& p = *stream_->codecpar;
  VideoInfo info;
  info.turn = TurnOf(*stream_, path_);
  info.pixel_aspect = PixelAspect(*stream_);
  info.interlaced = p.field_order > AV_FIELD_PROGRESSIVE;
  const bool swap = info.turn.swaps_sides();
  info.width = swap ? p.height : p.width;
  info.height = swap ? p.width : p.height;
  const AVRational rate = stream_->avg_frame_rate.num > 0 ? stream_->avg_frame_rate : stream_->r_frame_rate;
  info.frame_rate_hz = rate.num > 0 && rate.den > 0 ? av_q2d(rate) : 0;
  info.num_frames = promised();
  info.time_code_s = time_code_s();
  info.codec = avcodec_get_name(p.codec_id);
  if (const AVPixFmtDescriptor* format = av_pix_fmt_desc_get(static_cast<AVPixelFormat>(p.format))) {
    info.pixel_format = format->name;
    info.bits = format->comp[0].depth;
  }
  return info;
}

std::optional<double> VideoFile::time_code_s() const {
  const AVDictionaryEntry* tag = av_dict_get(stream_->metadata, "timecode", nullptr, 0);
  if (!tag) tag = av_dict_get(format_->metadata, "timecode", nullptr, 0);
  for (unsigned i = 0; i < format_->nb_streams && !tag; ++i) {
    tag = av_dict_get(format_->streams[i]->metadata, "timecode", nullptr, 0);
  }
  const AVRational rate = stream_->avg_frame_rate.num > 0 ? stream_->avg_frame_rate : stream_->r_frame_rate;
  AVTimecode code;
  if (!tag || rate.num <= 0 || rate.den <= 0 || av_timecode_init_from_string(&code, rate, tag->value, nullptr) < 0)
    return std::nullopt;
  // The count is of 30 frames a second at 29.97 Hz too, but for drop-frame codes, whose labels follow the time of day.
  const bool drops = (code.flags & AV_TIMECODE_FLAG_DROPFRAME) != 0;
  return code.start * (drops ? 1.001 : 1) / static_cast<double>(code.fps);
}

double VideoFile::Seconds(int64_t pts) const {
  return pts == AV_NOPTS_VALUE ? std::nan("") : static_cast<double>(pts) * av_q2d(stream_->time_base);
}

int VideoFile::io_error() const { return format_->pb ? std::min(format_->pb->error, 0) : 0; }

/// Packets come in decoding order. A decoder holds `video_delay` frames back and shows the earliest first; at a key frame with
/// which time jumps back it shows all it holds.
PacketScan ScanPackets(VideoFile* file) {
  PacketScan scan;
  std::priority_queue<int64_t, std::vector<int64_t>, std::greater<int64_t>> held;
  const size_t delay = static_cast<size_t>(std::max(file->stream()->codecpar->video_delay, 0));
  const auto show_down_to = [&](size_t size) {
    for (; held.size() > size; held.pop()) scan.pts.push_back(held.top());
  };
  int code = 0;
  while ((code = file->Read()) == 0) {
    const AVPacket& packet = *file->packet();
    scan.ends_in_packet = packet.flags & AV_PKT_FLAG_CORRUPT;
    if (scan.ends_in_packet) scan.cut_short = "a packet is cut short";
    if (packet.dts != AV_NOPTS_VALUE) scan.last_dts = std::max(scan.last_dts, packet.dts);
    if (packet.flags & AV_PKT_FLAG_DISCARD) {
      ++scan.discarded;
      continue;
    }
    if (packet.pts == AV_NOPTS_VALUE) {
      show_down_to(0);
      scan.pts.push_back(packet.pts);
      continue;
    }
    const bool jumps_back = !scan.pts.empty() && scan.pts.back() != AV_NOPTS_VALUE && packet.pts < scan.pts.back();
    if (jumps_back && (packet.flags & AV_PKT_FLAG_KEY)) show_down_to(0);
    held.push(packet.pts);
    show_down_to(delay);
  }
  show_down_to(0);
  if (code != AVERROR_EOF) scan.cut_short = "cannot read (" + AvErrorText(code) + ")";
  if (file->io_error() < 0) scan.cut_short = "cannot read (" + AvErrorText(file->io_error()) + ")";
  return scan;
}

bool EndsEarly(double last_s, int64_t num_frames, double rate_hz, double duration_s) {
  const double stated_s = rate_hz > 0 ? 1 / rate_hz : 0;  // libav's guess is far off when the rate varies
  const double mean_s = num_frames > 1 ? last_s / static_cast<double>(num_frames - 1) : 0;
  const double step_s = std::max(stated_s, mean_s);
  return duration_s > 0 && last_s + (step_s > 0 ? 2.5 * step_s : 1) < duration_s;
}

}  // namespace internal

VideoTimes ReadVideoTimes(const std::string& path) {
  internal::VideoFile file(path, 0);
  const internal::PacketScan scan = internal::ScanPackets(&file);
  VideoTimes times;
  times.promised = std::max<int64_t>(file.promised() - scan.discarded, 0);
  times.cut_short = scan.cut_short;
  times.time_code_s = file.time_code_s();
  for (const int64_t pts : scan.pts) times.time_s.push_back(file.Seconds(pts));
  const auto count = static_cast<int64_t>(times.time_s.size());
  if (internal::AllSame(scan.pts) && scan.pts[0] != AV_NOPTS_VALUE)
    throw FormatError(path, "", "its " + std::to_string(count) + " " + internal::kOneTime);
  if (times.cut_short.empty() && count < times.promised) {
    times.cut_short = "it ends after " + std::to_string(count) + " of " + std::to_string(times.promised) + " frames";
  }
  const double duration_s = file.tagged_duration_s(), rate_hz = file.info().frame_rate_hz;
  const double last_s = times.time_s.empty() ? 0 : times.time_s.back();
  if (times.cut_short.empty() && times.promised <= 0 && internal::EndsEarly(last_s, count, rate_hz, duration_s)) {
    times.cut_short = "it ends before the " + std::to_string(duration_s) + " s that its header states";
  }
  return times;
}

}  // namespace mvstudio::dataset
