#include "dataset/pack/image_codec.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstring>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "core/check.h"
#include "core/error.h"

namespace mvstudio::dataset {

std::string ToString(const PackCodec& codec) {
  if (codec.kind == PackCodec::Kind::kJpeg) return "jpeg:" + std::to_string(codec.quality);
  return codec.kind == PackCodec::Kind::kPng ? "png" : "raw";
}

void FromString(const std::string& text, PackCodec* codec) {
  if (text == "png" || text == "raw") {
    *codec = {text == "png" ? PackCodec::Kind::kPng : PackCodec::Kind::kRaw, 0};
    return;
  }
  const std::string digits = text.rfind("jpeg:", 0) == 0 ? text.substr(5) : "";
  const bool number = !digits.empty() && digits.size() <= 3 &&
                      std::all_of(digits.begin(), digits.end(), [](unsigned char c) { return std::isdigit(c); });
  const int quality = number ? std::stoi(digits) : 0;
  if (quality < 1 || quality > 100)
    throw UsageError("option 'codec' '" + text + "': use png, raw, or jpeg:Q with Q from 1 to 100");
  *codec = {PackCodec::Kind::kJpeg, quality};
}

}  // namespace mvstudio::dataset

namespace mvstudio::dataset::internal {
namespace {

struct Size {
  int width = 0, height = 0;
};

uint32_t BigEndian(std::string_view bytes, size_t at, int count) {
  uint32_t value = 0;
  for (int k = 0; k < count; ++k) value = value << 8 | static_cast<uint8_t>(bytes[at + k]);
  return value;
}

// From the header chunk; 0 x 0 when it is no PNG.
Size PngSize(std::string_view bytes) {
  constexpr std::string_view kStart("\x89PNG\r\n\x1a\n\0\0\0\rIHDR", 16);
  if (bytes.size() < 24 || bytes.substr(0, 16) != kStart) return {};
  return {static_cast<int>(BigEndian(bytes, 16, 4) & 0x7fffffff), static_cast<int>(BigEndian(bytes, 20, 4) & 0x7fffffff)};
}

// From the frame header (ITU-T T.81, B.2.2); 0 x 0 when there is none before the first scan.
Size JpegSize(std::string_view bytes) {
  if (bytes.size() < 4 || bytes.substr(0, 2) != "\xff\xd8") return {};
  for (size_t at = 2; at + 9 <= bytes.size() && bytes[at] == '\xff';) {
    const uint32_t marker = BigEndian(bytes, at + 1, 1);
    if (marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc) {
      return {static_cast<int>(BigEndian(bytes, at + 7, 2)), static_cast<int>(BigEndian(bytes, at + 5, 2))};
    }
    if (marker == 0xda) return {};
    at += 2 + BigEndian(bytes, at + 2, 2);
  }
  return {};
}

std::string Encode(const cv::Mat& mat, const char* extension, const std::vector<int>& options) {
  std::vector<uint8_t> bytes;
  bool encoded = false;
  try {
    encoded = cv::imencode(extension, mat, bytes, options);
  } catch (const cv::Exception&) {  // it has got no memory: the size is checked before
  }
  if (!encoded)
    throw ResourceError("an image of " + std::to_string(mat.cols) + "x" + std::to_string(mat.rows) + " px cannot be encoded");
  return {bytes.begin(), bytes.end()};
}

cv::Mat View(const Image& image) {
  return cv::Mat(image.height, image.width, image.channels == 3 ? CV_8UC3 : CV_8UC1, const_cast<uint8_t*>(image.pixels.data()));
}

// Decodes into `image`, whose size the bytes are known to have; false when that fails.
bool Decode(std::string_view bytes, Image* image) {
  const cv::Mat raw(1, static_cast<int>(bytes.size()), CV_8U, const_cast<char*>(bytes.data()));
  const int flags = image->channels == 3 ? cv::IMREAD_COLOR : cv::IMREAD_GRAYSCALE;
  try {
    const cv::Mat decoded = cv::imdecode(raw, flags | cv::IMREAD_IGNORE_ORIENTATION);
    if (decoded.cols != image->width || decoded.rows != image->height || decoded.channels() != image->channels) return false;
    cv::Mat target = View(*image);
    if (image->channels == 3) {
      cv::cvtColor(decoded, target, cv::COLOR_BGR2RGB);
    } else {
      decoded.copyTo(target);
    }
  } catch (const cv::Exception&) {
    return false;
  }
  return true;
}

void RequireSize(const Size& found, const Image& wanted, const std::string& path, const std::string& where) {
  if (found.width == wanted.width && found.height == wanted.height) return;
  throw FormatError(path, where,
                    found.width == 0
                        ? "is not stored in the pack's codec"
                        : "is " + std::to_string(found.width) + "x" + std::to_string(found.height) +
                              ", the pack's table says " + std::to_string(wanted.width) + "x" + std::to_string(wanted.height));
}

}  // namespace

std::string EncodeImage(const Image& image, const PackCodec& codec) {
  MVS_CHECK(image.channels == 3 && !image.empty(), image.width << "x" << image.height << "x" << image.channels);
  if (codec.kind == PackCodec::Kind::kRaw) return {image.pixels.begin(), image.pixels.end()};
  cv::Mat bgr;
  cv::cvtColor(View(image), bgr, cv::COLOR_RGB2BGR);
  if (codec.kind == PackCodec::Kind::kPng) return Encode(bgr, ".png", {});
  return Encode(bgr, ".jpg", {cv::IMWRITE_JPEG_QUALITY, codec.quality});
}

std::string EncodeMask(const Image& mask) {
  MVS_CHECK(mask.channels == 1 && !mask.empty(), mask.width << "x" << mask.height << "x" << mask.channels);
  return Encode(View(mask), ".png", {cv::IMWRITE_PNG_BILEVEL, 1});
}

Image DecodeImage(std::string_view bytes, const PackCodec& codec, int width, int height, const std::string& path,
                  const std::string& where) {
  Image image(width, height, 3);
  if (codec.kind == PackCodec::Kind::kRaw) {
    if (bytes.size() != image.pixels.size()) throw FormatError(path, where, "has the wrong number of bytes for a raw image");
    std::memcpy(image.pixels.data(), bytes.data(), bytes.size());
    return image;
  }
  RequireSize(codec.kind == PackCodec::Kind::kPng ? PngSize(bytes) : JpegSize(bytes), image, path, where);
  if (!Decode(bytes, &image)) throw FormatError(path, where, "cannot be decoded");
  return image;
}

Image DecodeMask(std::string_view bytes, int width, int height, const std::string& path, const std::string& where) {
  Image mask(width, height, 1);
  RequireSize(PngSize(bytes), mask, path, where);
  if (!Decode(bytes, &mask)) throw FormatError(path, where, "cannot be decoded");
  return mask;
}

uint32_t Crc32(std::string_view bytes) {
  // Eight bytes a step (Kounavis and Berry, ISCC 2005).
  using Tables = std::array<std::array<uint32_t, 256>, 8>;
  static const Tables tables = [] {
    Tables t{};
    for (uint32_t n = 0; n < 256; ++n) {
      uint32_t c = n;
      for (int k = 0; k < 8; ++k) c = c & 1 ? 0xedb88320u ^ (c >> 1) : c >> 1;
      t[0][n] = c;
    }
    for (uint32_t n = 0; n < 256; ++n) {
      for (int k = 1; k < 8; ++k) t[k][n] = t[k - 1][n] >> 8 ^ t[0][t[k - 1][n] & 0xff];
    }
    return t;
  }();
  uint32_t crc = 0xffffffffu;
  const auto* p = reinterpret_cast<const uint8_t*>(bytes.data());
  size_t left = bytes.size();
  for (; left >= 8; left -= 8, p += 8) {
    const uint32_t low = crc ^ (p[0] | uint32_t{p[1]} << 8 | uint32_t{p[2]} << 16 | uint32_t{p[3]} << 24);
    crc = tables[7][low & 0xff] ^ tables[6][low >> 8 & 0xff] ^ tables[5][low >> 16 & 0xff] ^ tables[4][low >> 24] ^
          tables[3][p[4]] ^ tables[2][p[5]] ^ tables[1][p[6]] ^ tables[0][p[7]];
  }
  for (; left > 0; --left, ++p) crc = tables[0][(crc ^ *p) & 0xff] ^ (crc >> 8);
  return ~crc;
}

}  // namespace mvstudio::dataset::internal
