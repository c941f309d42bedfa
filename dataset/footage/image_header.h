// Private: for image_io.cc.
#pragma once

#include <cstdint>
#include <string>

#include "dataset/footage/image_io.h"

/// Headers of image files, read before any decoder sees the file.
namespace mvstudio::dataset::internal {

/// A file's bytes, whole or its first ones; `end` holds its last ones where `start` does not reach them (PNG may have EXIF
/// behind its pixels).
struct ImageBytes {
  const std::string &start, &end;
};

/// Throws FormatError for a file of another kind, a damaged header, and sides beyond the limits of ReadImage.
ImageHeader ParseImageHeader(const ImageBytes& bytes, const std::string& path);

/// Throws FormatError for a binary PGM or PPM file that ends before its pixels do.
void CheckPnm(const std::string& bytes, const std::string& path);

/// The bytes of a TIFF file with its Orientation tag set to 1: decoders apply some of its values and not others.
std::string WithoutTiffOrientation(std::string bytes);

/// CRC-32 of PNG (ISO 3309).
uint32_t Crc32(const std::string& bytes, size_t begin, size_t size);
uint32_t BigEndian32(const std::string& bytes, size_t at);

}  // namespace mvstudio::dataset::internal
