#include <cmath>

#include "dataset/footage/image_io.h"
#include "dataset/footage/video_io.h"
#include "tests/fuzz/fuzz.h"

/// Images and video. The decoders themselves are OpenCV's and libav's; ours are the checks before and after them.
namespace mvstudio::fuzz {
namespace {

uint32_t Crc32(std::string_view bytes) {
  uint32_t crc = 0xffffffffu;
  for (const char byte : bytes) {
    crc ^= static_cast<uint8_t>(byte);
    for (int k = 0; k < 8; ++k) crc = crc & 1 ? 0xedb88320u ^ (crc >> 1) : crc >> 1;
  }
  return ~crc;
}

/// Puts right the checksums of a PNG file, so that mutated chunks are not all refused at the door.
std::string WithChecksums(std::string_view bytes) {
  std::string png(bytes);
  for (size_t at = 8; at + 12 <= png.size();) {
    size_t length = 0;
    for (size_t i = 0; i < 4; ++i) length = length << 8 | static_cast<uint8_t>(png[at + i]);
    if (length > png.size() - at - 12) break;
    const uint32_t crc = Crc32(std::string_view(png).substr(at + 4, length + 4));
    for (size_t i = 0; i < 4; ++i) png[at + 8 + length + i] = static_cast<char>(crc >> (24 - 8 * i));
    at += 12 + length;
  }
  return png;
}

void RunImage(const std::string& path) {
  for (const bool grey : {false, true}) {
    Image image;
    if (!Accepts([&] { image = dataset::ReadImage(path, grey); })) continue;
    Require(image.width > 0 && image.height > 0 && image.channels == (grey ? 1 : 3), "the picture has no size");
  }
}

}  // namespace

MVS_FUZZ_TARGET(image, bytes) {
  RunImage(InMemory("in.png", bytes));
  if (bytes.size() > 8 && bytes.substr(1, 3) == "PNG") RunImage(InMemory("in.png", WithChecksums(bytes)));
}

MVS_FUZZ_TARGET(video, bytes) {
  const std::string path = Scratch("in.mp4", bytes);
  Accepts([&] {
    dataset::VideoReader reader(path);
    for (int i = 0; i < 20; ++i) {
      const auto frame = reader.Next();
      if (!frame) return;
      Require(frame->width == reader.info().width && frame->height == reader.info().height, "a frame of another size");
    }
  });
}

}  // namespace mvstudio::fuzz
