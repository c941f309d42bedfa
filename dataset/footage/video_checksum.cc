#include "dataset/footage/video_checksum.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavutil/crc.h>
}

namespace mvstudio::dataset::internal {
namespace {

/// Slices follow each other, each with a footer: slice_size (3 bytes). If the stream has checksums, error_status (1) and
/// slice_crc_parity (4) follow, which makes the slice's CRC-32 zero (RFC 9043, 4.8 and 4.9.3).
constexpr int kFooter = 8;

/// Whether the sizes in the footers lead from the packet's end to its beginning; then whether all checksums fit.
bool FollowSlices(const uint8_t* data, int size, bool* sound) {
  *sound = true;
  int end = size;
  while (end > kFooter) {
    const uint8_t* at = data + end - kFooter;
    const int length = (at[0] << 16 | at[1] << 8 | at[2]) + kFooter;
    if (length > end) return false;
    end -= length;
    *sound &= av_crc(av_crc_get_table(AV_CRC_32_IEEE), 0, data + end, static_cast<size_t>(length)) == 0;
  }
  return end == 0;
}

}  // namespace

bool SliceChecksums::IsDamaged(const AVPacket& packet) {
  bool sound = true;
  if (FollowSlices(packet.data, packet.size, &sound)) {
    present_ = true;
    return !sound;
  }
  return present_;
}

}  // namespace mvstudio::dataset::internal
