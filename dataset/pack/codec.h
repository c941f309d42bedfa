// Private: the bytes of pictures in a pack are not for other modules.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "core/image.h"

namespace mvstudio::dataset::internal {

/// Encoding of pictures: "png", "jpeg:Q" with Q from 1 to 100, "raw" (rows of RGB bytes).
struct Codec {
  enum class Kind { kPng, kJpeg, kRaw };
  Kind kind = Kind::kPng;
  int quality = 0;
};

/// Throws UsageError.
Codec ParseCodec(const std::string& text);
std::string ToString(const Codec& codec);

std::string EncodeImage(const Image& image, const Codec& codec);
/// One bit a pixel, PNG.
std::string EncodeMask(const Image& mask);

/// Throws FormatError ("`path`: `where`: …") unless the bytes are a picture of exactly this size; the size is checked
/// before decoding.
Image DecodeImage(std::string_view bytes, const Codec& codec, int width, int height, const std::string& path,
                  const std::string& where);
Image DecodeMask(std::string_view bytes, int width, int height, const std::string& path, const std::string& where);

/// CRC-32 of ISO 3309, as zlib.crc32.
uint32_t Crc32(std::string_view bytes);

}  // namespace mvstudio::dataset::internal
