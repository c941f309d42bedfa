#pragma once

#include <string>

#include "core/image.h"

namespace mvstudio::dataset {

/// Reads PNG or JPEG; RGB, or grey when `grey`. Ignores EXIF rotation. Throws IoError / FormatError.
Image ReadImage(const std::string& path, bool grey = false);
/// Writes PNG, or JPEG with `jpeg_quality`, by extension, atomically.
void WriteImage(const Image& image, const std::string& path, int jpeg_quality = 95);

}  // namespace mvstudio::dataset
