#pragma once

#include <cstdint>
#include <string>

#include "core/image.h"

namespace mvstudio::dataset {

/// The most pixels that a picture or a frame may have: 2^27, or MVSTUDIO_MAX_MEGAPIXELS of the environment. What is larger is
/// refused from its header, before memory is taken for it.
int64_t MaxPixels();

struct ImageHeader {
  int64_t width = 0, height = 0;
  int channels = 0, bits = 0;
  bool is_png = false;
};
/// Size of a PNG or JPEG from its first kilobytes; the rest is not read. Throws IoError / FormatError.
ImageHeader ReadImageHeader(const std::string& path);

/// Reads PNG or JPEG; RGB, or grey when `grey`. Ignores EXIF rotation. Throws IoError / FormatError, also for more than
/// MaxPixels() or sides beyond 65535, files beyond 1 GiB and JPEG of more than 500 scans.
Image ReadImage(const std::string& path, bool grey = false);
/// Writes PNG, or JPEG with `jpeg_quality`, by extension, atomically. Four channels are R, G, B and opacity, not multiplied: PNG
/// only.
void WriteImage(const Image& image, const std::string& path, int jpeg_quality = 95);
/// What WriteImage would write there.
std::string EncodeImage(const Image& image, const std::string& path, int jpeg_quality = 95);

}  // namespace mvstudio::dataset
