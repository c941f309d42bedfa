#include "dataset/footage/image_io.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "core/check.h"
#include "core/disk/files.h"
#include "core/disk/paths.h"
#include "core/disk/unpack.h"
#include "core/error.h"

namespace mvstudio::dataset {
namespace {

using Bytes = const std::string&;

uint8_t At(Bytes b, size_t i) { return static_cast<uint8_t>(b[i]); }

uint32_t BigEndian32(Bytes b, size_t i) {
  return uint32_t{At(b, i)} << 24 | uint32_t{At(b, i + 1)} << 16 | uint32_t{At(b, i + 2)} << 8 | uint32_t{At(b, i + 3)};
}

bool IsPng(Bytes b) { return b.size() >= 8 && b.compare(0, 8, "\x89PNG\r\n\x1a\n") == 0; }
bool IsJpeg(Bytes b) { return b.size() >= 3 && At(b, 0) == 0xff && At(b, 1) == 0xd8 && At(b, 2) == 0xff; }

/// CRC-32 of PNG (ISO 3309).
uint32_t Crc32(Bytes b, size_t begin, size_t size) {
  static const std::array<uint32_t, 256> table = [] {
    std::array<uint32_t, 256> t{};
    for (uint32_t n = 0; n < 256; ++n) {
      uint32_t c = n;
      for (int k = 0; k < 8; ++k) c = c & 1 ? 0xedb88320u ^ (c >> 1) : c >> 1;
      t[n] = c;
    }
    return t;
  }();
  uint32_t crc = 0xffffffffu;
  for (size_t i = begin; i < begin + size; ++i) crc = table[(crc ^ At(b, i)) & 0xff] ^ (crc >> 8);
  return ~crc;
}

constexpr int64_t kMaxSide = 65535;
constexpr uintmax_t kMaxFileBytes = uintmax_t{1} << 30;
constexpr int kMaxJpegScans = 500;

ImageHeader PngHeader(Bytes b, const std::string& path) {
  if (b.size() < 33 || b.compare(12, 4, "IHDR") != 0) throw FormatError(path, "byte 8", "the PNG file has no header");
  ImageHeader header{BigEndian32(b, 16), BigEndian32(b, 20), 1, At(b, 24), true};
  const uint8_t colour = At(b, 25);
  header.channels = colour == 2 || colour == 3 ? 3 : colour == 4 ? 2 : colour == 6 ? 4 : 1;
  return header;
}

/// The first frame header (SOF0 … SOF15 without DHT, JPG, DAC).
ImageHeader JpegHeader(Bytes b, const std::string& path) {
  for (size_t at = 2; at + 9 < b.size() && At(b, at) == 0xff;) {
    const uint8_t marker = At(b, at + 1);
    if (marker == 0xff) {
      ++at;
      continue;
    }
    if (marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc) {
      const auto side = [&](size_t i) { return int64_t{At(b, i)} << 8 | At(b, i + 1); };
      return {side(at + 7), side(at + 5), At(b, at + 9), At(b, at + 4), false};
    }
    at += 2 + (size_t{At(b, at + 2)} << 8 | At(b, at + 3));
  }
  throw FormatError(path, "", "the JPEG file has no frame header; it ends early or is damaged");
}

ImageHeader Header(Bytes b, const std::string& path) {
  if (!IsPng(b) && !IsJpeg(b)) throw FormatError(path, "", "is neither PNG nor JPEG");
  const ImageHeader header = IsPng(b) ? PngHeader(b, path) : JpegHeader(b, path);
  const std::string size = std::to_string(header.width) + "x" + std::to_string(header.height);
  if (header.width < 1 || header.height < 1) throw FormatError(path, "header", "an image of " + size + " pixels");
  if (header.width > kMaxSide || header.height > kMaxSide || header.width * header.height > MaxPixels()) {
    throw FormatError(path, "header",
                      "declares " + size + " pixels, more than the " + std::to_string(MaxPixels() >> 20) +
                          " Mi that are allowed; if it is sound, set MVSTUDIO_MAX_MEGAPIXELS");
  }
  return header;
}

/// Walks the chunks: decoders accept a file that ends early and give the missing rows some colour.
void CheckPng(Bytes b, const std::string& path) {
  size_t at = 8;
  while (at + 12 <= b.size()) {
    const size_t length = BigEndian32(b, at);
    if (length > b.size() - at - 12) break;
    const std::string type = b.substr(at + 4, 4);
    if (Crc32(b, at + 4, length + 4) != BigEndian32(b, at + 8 + length)) {
      throw FormatError(path, "chunk " + type, "checksum is wrong; the PNG file is damaged, copy it again");
    }
    if (type == "IEND") return;
    at += 12 + length;
  }
  throw FormatError(path, "byte " + std::to_string(b.size()), "the PNG file ends early; copy it again");
}

/// First byte after the entropy-coded data that starts at `at`.
size_t SkipScan(Bytes b, size_t at) {
  for (; at + 1 < b.size(); ++at) {
    if (At(b, at) != 0xff) continue;
    const uint8_t next = At(b, at + 1);
    if (next != 0 && next != 0xff && !(next >= 0xd0 && next <= 0xd7)) return at;
  }
  return b.size();
}

/// Walks the segments to the end-of-image marker.
void CheckJpeg(Bytes b, const std::string& path) {
  size_t at = 2;
  int scans = 0;
  while (at + 1 < b.size() && At(b, at) == 0xff) {
    const uint8_t marker = At(b, at + 1);
    if (marker == 0xd9) return;
    if (marker == 0xff) {
      ++at;
      continue;
    }
    if (at + 3 >= b.size()) break;
    at += 2 + (size_t{At(b, at + 2)} << 8 | At(b, at + 3));
    if (marker != 0xda) continue;
    if (++scans > kMaxJpegScans) throw FormatError(path, "byte " + std::to_string(at), "has too many scans to be an image");
    at = SkipScan(b, at);
  }
  throw FormatError(path, "byte " + std::to_string(std::min(at, b.size())),
                    "the JPEG file ends early or is damaged; copy it again");
}

std::string LowerExtension(const std::string& path) {
  std::string extension = std::filesystem::path(path).extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(), [](unsigned char c) { return std::tolower(c); });
  return extension;
}

Image FromMat(const cv::Mat& mat) {
  Image image(mat.cols, mat.rows, mat.channels());
  const size_t row_bytes = static_cast<size_t>(image.width) * image.channels;
  for (int y = 0; y < mat.rows; ++y) std::copy_n(mat.ptr(y), row_bytes, image.Pixel(0, y));
  return image;
}

/// The file, or its first `most` bytes.
std::string ReadStart(const std::string& path, size_t most) {
  std::ifstream in(path, std::ios::binary);
  if (!in) throw IoError(path, "cannot open");
  std::string bytes(most, '\0');
  in.read(bytes.data(), static_cast<std::streamsize>(most));
  if (in.bad()) throw IoError(path, "cannot read");
  bytes.resize(static_cast<size_t>(std::max<std::streamsize>(in.gcount(), 0)));
  return bytes;
}

void CheckFileSize(const std::string& path) {
  RequireRegularFile(path);
  std::error_code error;
  const uintmax_t size = std::filesystem::file_size(path, error);
  if (error) return;  // reading says why
  if (size == 0) throw FormatError(path, "", "the file is empty");
  if (size > kMaxFileBytes) throw FormatError(path, "", "is larger than 1 GiB: not an image");
}

}  // namespace

int64_t MaxPixels() {
  constexpr int64_t kUsual = int64_t{1} << 27;
  const char* text = std::getenv("MVSTUDIO_MAX_MEGAPIXELS");
  const double megapixels = text ? std::atof(text) : 0;
  return megapixels > 0 && megapixels < 1e6 ? std::max<int64_t>(static_cast<int64_t>(megapixels * 1e6), 1) : kUsual;
}

ImageHeader ReadImageHeader(const std::string& path) {
  CheckFileSize(path);
  const std::string start = ReadStart(path, 4096);
  if (IsPng(start)) return Header(start, path);
  return Header(ReadStart(path, 1 << 20), path);  // EXIF thumbnails and profiles come before a JPEG's size
}

Image ReadImage(const std::string& path, bool grey) {
  CheckFileSize(path);
  const std::string bytes = ReadFile(path);
  if (bytes.empty()) throw FormatError(path, "", "the file is empty");
  const ImageHeader header = Header(bytes, path);
  if (header.is_png) {
    const int64_t pixels = header.width * header.height * header.channels;
    if (OutOfProportion(static_cast<uint64_t>(pixels * std::max(1, header.bits / 8)), bytes.size()))
      throw FormatError(path, "header",
                        "declares " + std::to_string(header.width) + "x" + std::to_string(header.height) + " pixels of " +
                            std::to_string(header.bits) + " bits, out of all proportion to the file's " +
                            std::to_string(bytes.size()) + " bytes: an image of one colour; refused");
    CheckPng(bytes, path);
  } else {
    CheckJpeg(bytes, path);
  }
  cv::Mat mat;
  try {
    const cv::Mat raw(1, static_cast<int>(bytes.size()), CV_8U, const_cast<char*>(bytes.data()));
    mat = cv::imdecode(raw, (grey ? cv::IMREAD_GRAYSCALE : cv::IMREAD_COLOR) | cv::IMREAD_IGNORE_ORIENTATION);
    if (!mat.empty() && !grey) cv::cvtColor(mat, mat, cv::COLOR_BGR2RGB);
  } catch (const cv::Exception& error) {
    throw FormatError(path, "", "cannot decode the image: " + error.err);
  }
  if (mat.empty()) throw FormatError(path, "", "cannot decode the image; the file is damaged");
  return FromMat(mat);
}

std::string EncodeImage(const Image& image, const std::string& path, int jpeg_quality) {
  const bool has_alpha = image.channels == 4;
  MVS_CHECK(image.width > 0 && image.height > 0 && (image.channels == 1 || image.channels == 3 || has_alpha),
            path << ": image of " << image.width << "x" << image.height << "x" << image.channels);
  MVS_CHECK(jpeg_quality >= 0 && jpeg_quality <= 100, "jpeg_quality " << jpeg_quality);
  const std::string extension = LowerExtension(path);
  if (extension != ".png" && extension != ".jpg" && extension != ".jpeg") {
    throw UsageError(path + ": images are written as .png or .jpg");
  }
  if (has_alpha && extension != ".png") throw UsageError(path + ": images with alpha are written as .png");
  const cv::Mat view(image.height, image.width, CV_8UC(image.channels), const_cast<uint8_t*>(image.pixels.data()));
  cv::Mat swapped;
  if (image.channels >= 3) cv::cvtColor(view, swapped, has_alpha ? cv::COLOR_RGBA2BGRA : cv::COLOR_RGB2BGR);
  const cv::Mat& bgr = image.channels >= 3 ? swapped : view;
  std::vector<int> options;
  if (extension != ".png") options = {cv::IMWRITE_JPEG_QUALITY, jpeg_quality};
  std::vector<uint8_t> bytes;
  try {
    if (!cv::imencode(extension, bgr, bytes, options)) throw IoError(path, "cannot encode the image");
  } catch (const cv::Exception& error) {
    throw IoError(path, "cannot encode the image: " + error.err);
  }
  return std::string(bytes.begin(), bytes.end());
}

Image Reduced(const Image& image, int longer_side_px) {
  MVS_CHECK(!image.empty() && longer_side_px > 0, "an image of " << image.width << "x" << image.height << " to be reduced");
  const int longer = std::max(image.width, image.height);
  if (longer <= longer_side_px) return image;
  const auto side = [&](int full) { return std::max(1, static_cast<int>(int64_t{full} * longer_side_px / longer)); };
  Image reduced(side(image.width), side(image.height), image.channels);
  const int type = CV_8UC(image.channels);
  const cv::Mat from(image.height, image.width, type, const_cast<uint8_t*>(image.pixels.data()));
  cv::Mat to(reduced.height, reduced.width, type, reduced.pixels.data());
  cv::resize(from, to, to.size(), 0, 0, cv::INTER_AREA);
  return reduced;
}

void WriteImage(const Image& image, const std::string& path, int jpeg_quality) {
  WriteFileAtomic(path, EncodeImage(image, path, jpeg_quality));
}

}  // namespace mvstudio::dataset
