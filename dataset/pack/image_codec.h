// Private: the bytes of images in a pack are not for other modules.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "core/image.h"
#include "dataset/pack/codec.h"

namespace mvstudio::dataset::internal {

std::string EncodeImage(const Image& image, const PackCodec& codec);
/// One bit a pixel, PNG.
std::string EncodeMask(const Image& mask);

/// Throws FormatError ("`path`: `where`: …") unless the bytes are an image of exactly this size; the size is checked
/// before decoding.
Image DecodeImage(std::string_view bytes, const PackCodec& codec, int width, int height, const std::string& path,
                  const std::string& where);
Image DecodeMask(std::string_view bytes, int width, int height, const std::string& path, const std::string& where);

/// CRC-32 of ISO 3309, as zlib.crc32.
uint32_t Crc32(std::string_view bytes);

}  // namespace mvstudio::dataset::internal
