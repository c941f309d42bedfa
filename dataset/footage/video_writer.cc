#include <cerrno>
#include <memory>
#include <string>

#include "core/check.h"
#include "core/disk/output.h"
#include "core/error.h"
#include "dataset/footage/libav_util.h"
#include "dataset/footage/video_io.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/opt.h>
#include <libswscale/swscale.h>
}

namespace mvstudio::dataset {
namespace {

/// With the AVX-512 code of x264's macroblock tree (r3095) the same frames gave different bytes from run to run at most small
/// sizes; with its AVX2 code, or without that tree, they did not.
void MakeRepeatable(AVCodecContext* codec) {
#ifdef __x86_64__
  if (__builtin_cpu_supports("avx512f")) av_opt_set(codec->priv_data, "x264-params", "asm=AVX2", 0);
#else
  (void)codec;
#endif
}

}  // namespace

struct VideoWriter::Impl {
  std::string path;
  std::unique_ptr<AtomicFile> file;
  int width = 0, height = 0;
  AVFormatContext* format = nullptr;
  AVCodecContext* codec = nullptr;
  AVStream* stream = nullptr;
  AVFrame* frame = nullptr;
  AVPacket* packet = nullptr;
  SwsContext* converter = nullptr;
  int64_t next_pts = 0;
  bool header_written = false, closed = false;

  ~Impl() {
    sws_freeContext(converter);
    av_packet_free(&packet);
    av_frame_free(&frame);
    avcodec_free_context(&codec);
    if (format) {
      if (format->pb) avio_closep(&format->pb);
      avformat_free_context(format);
    }
  }

  void Check(int code, const std::string& action) const {
    if (code >= 0) return;
    const std::string text = path + ": " + action + ": " + internal::AvErrorText(code);
    if (code == AVERROR(ENOSPC) || code == AVERROR(EDQUOT) || code == AVERROR(ENOMEM)) throw ResourceError(text);
    throw IoError(path, action + ": " + internal::AvErrorText(code));
  }

  /// libav would take a name with a colon for a protocol.
  std::string Url() const { return "file:" + file->temporary(); }
  void OpenCodec(double frame_rate_hz, int crf, bool full_chroma);
  void OpenFile();
  void Encode(const AVFrame* input);
};

void VideoWriter::Impl::OpenCodec(double frame_rate_hz, int crf, bool full_chroma) {
  const AVCodec* encoder = avcodec_find_encoder_by_name("libx264");
  if (!encoder) throw MissingToolError("this libavcodec has no libx264 encoder; install a build that has it");
  codec = avcodec_alloc_context3(encoder);
  if (!codec) throw ResourceError(path + ": out of memory");
  const AVRational rate = av_d2q(frame_rate_hz, 1001000);
  codec->width = width;
  codec->height = height;
  codec->framerate = rate;
  codec->time_base = av_inv_q(rate);
  codec->pix_fmt = full_chroma ? AV_PIX_FMT_YUV444P : AV_PIX_FMT_YUV420P;
  codec->color_range = AVCOL_RANGE_MPEG;
  codec->colorspace = AVCOL_SPC_BT709;
  codec->color_primaries = AVCOL_PRI_BT709;
  codec->color_trc = AVCOL_TRC_BT709;
  codec->chroma_sample_location = AVCHROMA_LOC_LEFT;
  codec->thread_count = 2;  // fixed: the bytes depend on it
  if (format->oformat->flags & AVFMT_GLOBALHEADER) codec->flags |= AV_CODEC_FLAG_GLOBAL_HEADER;
  codec->flags |= AV_CODEC_FLAG_BITEXACT;
  av_opt_set(codec->priv_data, "preset", "veryfast", 0);
  av_opt_set(codec->priv_data, "crf", std::to_string(crf).c_str(), 0);
  MakeRepeatable(codec);
  Check(avcodec_open2(codec, encoder, nullptr), "cannot start libx264");
}

void VideoWriter::Impl::OpenFile() {
  stream = avformat_new_stream(format, nullptr);
  if (!stream) throw ResourceError(path + ": out of memory");
  Check(avcodec_parameters_from_context(stream->codecpar, codec), "cannot describe the stream");
  stream->time_base = codec->time_base;
  stream->avg_frame_rate = codec->framerate;
  format->flags |= AVFMT_FLAG_BITEXACT;
  Check(avio_open(&format->pb, Url().c_str(), AVIO_FLAG_WRITE), "cannot create");
  AVDictionary* options = nullptr;
  av_dict_set(&options, "movflags", "+faststart+write_colr", 0);
  const int code = avformat_write_header(format, &options);
  av_dict_free(&options);
  Check(code, "cannot write the header");
  header_written = true;
}

void VideoWriter::Impl::Encode(const AVFrame* input) {
  Check(avcodec_send_frame(codec, input), "cannot encode");
  while (true) {
    const int code = avcodec_receive_packet(codec, packet);
    if (code == AVERROR(EAGAIN) || code == AVERROR_EOF) return;
    Check(code, "cannot encode");
    packet->duration = 1;
    av_packet_rescale_ts(packet, codec->time_base, stream->time_base);
    packet->stream_index = stream->index;
    Check(av_interleaved_write_frame(format, packet), "cannot write");
  }
}

VideoWriter::VideoWriter(const std::string& path, int width, int height, double frame_rate_hz, int crf, bool full_chroma)
    : impl_(std::make_unique<Impl>()) {
  MVS_CHECK(width > 0 && height > 0 && (full_chroma || (width % 2 == 0 && height % 2 == 0)),
            path << ": video size " << width << "x" << height << " must be even");
  MVS_CHECK(frame_rate_hz > 0 && frame_rate_hz < 1e5, path << ": frame rate " << frame_rate_hz);
  MVS_CHECK(crf >= 0 && crf <= 51, path << ": crf " << crf << " is not in 0..51");
  internal::SilenceLibav();
  Impl& w = *impl_;
  w.path = path, w.width = width, w.height = height;
  w.file = std::make_unique<AtomicFile>(path);
  w.Check(avformat_alloc_output_context2(&w.format, nullptr, "mp4", w.Url().c_str()), "cannot prepare the file");
  w.OpenCodec(frame_rate_hz, crf, full_chroma);
  w.OpenFile();
  w.frame = av_frame_alloc();
  w.packet = av_packet_alloc();
  w.converter = internal::MakeFromRgbConverter(width, height, w.codec->pix_fmt);
  if (!w.frame || !w.packet || !w.converter) throw ResourceError(path + ": out of memory");
  w.frame->width = width, w.frame->height = height, w.frame->format = w.codec->pix_fmt;
  w.frame->color_range = AVCOL_RANGE_MPEG;
  w.frame->colorspace = AVCOL_SPC_BT709;
  w.Check(av_frame_get_buffer(w.frame, 0), "cannot allocate a frame");
}

VideoWriter::~VideoWriter() = default;

void VideoWriter::Write(const Image& rgb) {
  Impl& w = *impl_;
  MVS_CHECK(!w.closed, w.path << ": already closed");
  MVS_CHECK(rgb.width == w.width && rgb.height == w.height && rgb.channels == 3,
            w.path << ": frame of " << rgb.width << "x" << rgb.height << "x" << rgb.channels);
  w.Check(av_frame_make_writable(w.frame), "cannot allocate a frame");
  const uint8_t* planes[4] = {rgb.pixels.data()};
  const int strides[4] = {3 * rgb.width};
  sws_scale(w.converter, planes, strides, 0, rgb.height, w.frame->data, w.frame->linesize);
  w.frame->pts = w.next_pts++;
  w.Encode(w.frame);
}

void VideoWriter::Close() {
  Impl& w = *impl_;
  if (w.closed) return;
  MVS_CHECK(w.next_pts > 0, w.path << ": a video needs a frame");
  w.Encode(nullptr);
  w.Check(av_write_trailer(w.format), "cannot finish the file");
  w.Check(avio_closep(&w.format->pb), "cannot close");
  FilesTogether::TakeOrCommit(std::move(w.file));
  w.closed = true;
}

}  // namespace mvstudio::dataset
