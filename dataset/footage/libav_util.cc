#include "dataset/footage/libav_util.h"

#include <mutex>

extern "C" {
#include <libavutil/frame.h>
#include <libavutil/log.h>
#include <libavutil/mem.h>
#include <libavutil/opt.h>
#include <libavutil/pixdesc.h>
#include <libswscale/swscale.h>
}

namespace mvstudio::dataset::internal {
namespace {

struct Layout {
  int width = 0, height = 0, format = 0;
  int range = 0;  // 1: full
  int colorspace = SWS_CS_ITU709;
  int chroma_h = -513, chroma_v = -513;  // 1/256 of a luma sample; -513: libswscale's default
};

/// The deprecated yuvj formats are the plain ones with full range.
int PlainFormat(int format, bool* full_range) {
  switch (format) {
    case AV_PIX_FMT_YUVJ420P:
      *full_range = true;
      return AV_PIX_FMT_YUV420P;
    case AV_PIX_FMT_YUVJ422P:
      *full_range = true;
      return AV_PIX_FMT_YUV422P;
    case AV_PIX_FMT_YUVJ444P:
      *full_range = true;
      return AV_PIX_FMT_YUV444P;
    case AV_PIX_FMT_YUVJ440P:
      *full_range = true;
      return AV_PIX_FMT_YUV440P;
    default:
      return format;
  }
}

int Colorspace(const AVFrame& frame) {
  switch (frame.colorspace) {
    case AVCOL_SPC_BT709:
      return SWS_CS_ITU709;
    case AVCOL_SPC_BT470BG:
    case AVCOL_SPC_SMPTE170M:
      return SWS_CS_ITU601;
    case AVCOL_SPC_FCC:
      return SWS_CS_FCC;
    case AVCOL_SPC_SMPTE240M:
      return SWS_CS_SMPTE240M;
    case AVCOL_SPC_BT2020_NCL:
    case AVCOL_SPC_BT2020_CL:
      return SWS_CS_BT2020;
    default:
      return frame.height >= 720 || frame.width >= 1280 ? SWS_CS_ITU709 : SWS_CS_ITU601;
  }
}

void SetChromaPosition(const AVFrame& frame, Layout* layout) {
  const AVPixFmtDescriptor* format = av_pix_fmt_desc_get(static_cast<AVPixelFormat>(layout->format));
  if (!format || format->log2_chroma_w != 1 || format->log2_chroma_h != 1) return;
  const AVChromaLocation at = frame.chroma_location;
  const bool centred = at == AVCHROMA_LOC_CENTER || at == AVCHROMA_LOC_TOP || at == AVCHROMA_LOC_BOTTOM;
  layout->chroma_h = centred ? 128 : 0;
  const bool top = at == AVCHROMA_LOC_TOPLEFT || at == AVCHROMA_LOC_TOP;
  const bool bottom = at == AVCHROMA_LOC_BOTTOMLEFT || at == AVCHROMA_LOC_BOTTOM;
  layout->chroma_v = top ? 0 : bottom ? 256 : 128;
}

SwsContext* Make(const Layout& from, const Layout& to) {
  SwsContext* context = sws_alloc_context();
  if (!context) return nullptr;
  const auto set = [context](const char* name, int value) { av_opt_set_int(context, name, value, 0); };
  set("srcw", from.width), set("srch", from.height), set("src_format", from.format), set("src_range", from.range);
  set("dstw", to.width), set("dsth", to.height), set("dst_format", to.format), set("dst_range", to.range);
  set("src_h_chr_pos", from.chroma_h), set("src_v_chr_pos", from.chroma_v);
  set("dst_h_chr_pos", to.chroma_h), set("dst_v_chr_pos", to.chroma_v);
  set("sws_flags", SWS_BICUBIC | SWS_ACCURATE_RND | SWS_FULL_CHR_H_INT | SWS_FULL_CHR_H_INP | SWS_BITEXACT);
  sws_setColorspaceDetails(context, sws_getCoefficients(from.colorspace), from.range, sws_getCoefficients(to.colorspace),
                           to.range, 0, 1 << 16, 1 << 16);
  if (sws_init_context(context, nullptr, nullptr) < 0) {
    sws_freeContext(context);
    return nullptr;
  }
  sws_setColorspaceDetails(context, sws_getCoefficients(from.colorspace), from.range, sws_getCoefficients(to.colorspace),
                           to.range, 0, 1 << 16, 1 << 16);
  return context;
}

}  // namespace

std::string AvErrorText(int code) {
  char text[AV_ERROR_MAX_STRING_SIZE] = {};
  av_strerror(code, text, sizeof(text));
  return text;
}

void SilenceLibav() {
  static std::once_flag once;
  std::call_once(once, [] {
    av_log_set_level(AV_LOG_QUIET);
    av_max_alloc(size_t{512} << 20);  // a container of 2 kB may declare tables of gigabytes
  });
}

SwsContext* MakeToRgbConverter(const AVFrame& frame) {
  bool full_range = frame.color_range == AVCOL_RANGE_JPEG;
  Layout yuv{frame.width, frame.height, PlainFormat(frame.format, &full_range)};
  const AVPixFmtDescriptor* format = av_pix_fmt_desc_get(static_cast<AVPixelFormat>(yuv.format));
  if (!format) return nullptr;
  if (format->flags & AV_PIX_FMT_FLAG_RGB) full_range = true;
  yuv.range = full_range ? 1 : 0;
  yuv.colorspace = Colorspace(frame);
  SetChromaPosition(frame, &yuv);
  Layout rgb{frame.width, frame.height, AV_PIX_FMT_RGB24, 1, yuv.colorspace};
  return Make(yuv, rgb);
}

SwsContext* MakeFromRgbConverter(int width, int height, int pixel_format) {
  Layout yuv{width, height, pixel_format, 0, SWS_CS_ITU709};
  if (pixel_format == AV_PIX_FMT_YUV420P) yuv.chroma_h = 0, yuv.chroma_v = 128;
  return Make(Layout{width, height, AV_PIX_FMT_RGB24, 1, SWS_CS_ITU709}, yuv);
}

}  // namespace mvstudio::dataset::internal
