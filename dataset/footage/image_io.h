#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/image.h"
#include "dataset/footage/image_turn.h"

namespace mvstudio::dataset {

/// Maximum number of pixels of an image or a frame: 2^27, or MVSTUDIO_MAX_MEGAPIXELS of the environment. Larger ones are
/// refused from their header, before memory is allocated.
int64_t MaxPixels();

struct ImageHeader {
  int64_t width = 0, height = 0;  ///< as shown, after `turn`
  int channels = 0, bits = 0;
  std::string codec;  ///< "png", "jpeg", "tiff", "webp", "bmp", "pnm"
  ImageTurn turn;     ///< that EXIF or TIFF asks for
};
/// Properties of an image from its header; the pixels are not read. Throws IoError / FormatError.
ImageHeader ReadImageHeader(const std::string& path);

/// Reads PNG, JPEG, TIFF, WebP, BMP, PGM or PPM; RGB, or grey when `grey`: 8 bits, of 16 the upper ones; without opacity. The
/// image is turned and mirrored as EXIF's or TIFF's orientation says, unless `as_stored`. Throws IoError / FormatError, also
/// for more than MaxPixels() or sides beyond 65535, files beyond 1 GiB and JPEG of more than 500 scans.
Image ReadImage(const std::string& path, bool grey = false, bool as_stored = false);

/// An image of which what is bright and dark matters, not how bright.
struct StretchedImage {
  Image rgb;
  int levels = 0, of_levels = 256;  ///< that the image fills of those its file can hold; 0: it was not stretched
};
/// ReadImage; but where an image of more than 8 bits fills less than a quarter of its range, that part becomes 0 to 255 (one
/// pixel in 500 at either end left out).
StretchedImage ReadImageStretched(const std::string& path, bool as_stored = false);
/// The same as ReadImage, but with four channels (R, G, B and opacity, not premultiplied) where the file has opacity.
Image ReadImageWithAlpha(const std::string& path);

/// A file's own numbers, of 1 to 16 bits.
struct RawImage {
  int width = 0, height = 0, channels = 0;
  int most = 255;                // largest number that the file can hold: 1, 3, 15, 255 or 65535
  std::vector<uint16_t> values;  // (height, width, channels): grey; R, G, B; or R, G, B and opacity
};
/// Palettes come as their colours. Throws as ReadImage.
RawImage ReadRawImage(const std::string& path);

/// Writes PNG, or JPEG with `jpeg_quality`, by extension, atomically. Four channels are R, G, B and opacity, not
/// premultiplied: PNG only.
void WriteImage(const Image& image, const std::string& path, int jpeg_quality = 95);
/// The bytes that WriteImage would write.
std::string EncodeImage(const Image& image, const std::string& path, int jpeg_quality = 95);

/// The image reduced by averaging so that its longer side is at most `longer_side_px`; never enlarged.
Image Reduced(const Image& image, int longer_side_px);

}  // namespace mvstudio::dataset
