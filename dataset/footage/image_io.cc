#include "dataset/footage/image_io.h"

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <utility>
#include <vector>

#include "core/check.h"
#include "core/disk/files.h"
#include "core/disk/npy.h"
#include "core/disk/paths.h"
#include "core/error.h"
#include "dataset/footage/image_bytes.h"
#include "dataset/footage/image_header.h"

namespace mvstudio::dataset {
namespace {

using internal::BigEndian32;
using internal::Crc32;
using Bytes = const std::string&;

uint8_t At(Bytes b, size_t i) { return static_cast<uint8_t>(b[i]); }

constexpr uintmax_t kMaxFileBytes = uintmax_t{1} << 30;
constexpr int kMaxJpegScans = 500;

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

/// The file, or `most` bytes from `begin` on; a negative one counts from the end.
std::string ReadPart(const std::string& path, std::streamoff begin, size_t most) {
  std::ifstream in(path, std::ios::binary);
  if (!in) throw IoError(path, "cannot open");
  if (begin < 0) in.seekg(begin, std::ios::end);
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

void RequireProportion(const ImageHeader& header, size_t file_bytes, const std::string& path) {
  const int64_t bytes = header.width * header.height * header.channels * std::max(1, header.bits / 8);
  if (!OutOfProportion(static_cast<uint64_t>(bytes), file_bytes)) return;
  throw FormatError(path, "header",
                    "declares " + std::to_string(header.width) + "x" + std::to_string(header.height) + " pixels of " +
                        std::to_string(header.bits) + " bits, out of all proportion to the file's " +
                        std::to_string(file_bytes) + " bytes: an image of one colour; refused");
}

struct Decoded {
  ImageHeader header;
  cv::Mat mat;
};

/// The pixels as stored; `flags`: OpenCV's way to convert. The whole file is checked.
Decoded Decode(std::string bytes, const std::string& path, int flags) {
  if (bytes.empty()) throw FormatError(path, "", "the file is empty");
  Decoded file{internal::ParseImageHeader({bytes, bytes}, path), {}};
  if (file.header.codec == "png") {
    RequireProportion(file.header, bytes.size(), path);
    CheckPng(bytes, path);
  }
  if (file.header.codec == "jpeg") CheckJpeg(bytes, path);
  if (file.header.codec == "pnm") internal::CheckPnm(bytes, path);
  if (file.header.codec == "tiff") bytes = internal::WithoutTiffOrientation(std::move(bytes));
  try {
    const cv::Mat raw(1, static_cast<int>(bytes.size()), CV_8U, bytes.data());
    // OpenCV knows no combination of IMREAD_UNCHANGED; it ignores the orientation by itself.
    file.mat = cv::imdecode(raw, flags == cv::IMREAD_UNCHANGED ? flags : flags | cv::IMREAD_IGNORE_ORIENTATION);
  } catch (const cv::Exception& error) {
    throw FormatError(path, "", "cannot decode the image: " + error.err);
  }
  const bool swap = file.header.turn.swaps_sides();
  const int64_t width = swap ? file.header.height : file.header.width, height = swap ? file.header.width : file.header.height;
  if (file.mat.cols != width || file.mat.rows != height)
    throw FormatError(path, "", "cannot decode the image; the file is damaged");
  return file;
}

Decoded Decode(const std::string& path, int flags) {
  CheckFileSize(path);
  return Decode(ReadFile(path), path, flags);
}

/// Least and greatest value, but for one in 500 at either end.
std::pair<double, double> UsedRange(const cv::Mat& mat) {
  constexpr size_t kLeftOut = 500;
  cv::Mat values;
  mat.reshape(1, 1).convertTo(values, CV_32F);
  std::vector<float> all(values.ptr<float>(), values.ptr<float>() + values.total());
  const size_t out = all.size() / kLeftOut;
  std::nth_element(all.begin(), all.begin() + static_cast<ptrdiff_t>(out), all.end());
  const double low = all[out];
  std::nth_element(all.begin(), all.end() - 1 - static_cast<ptrdiff_t>(out), all.end());
  return {low, all[all.size() - 1 - out]};
}

}  // namespace

int64_t MaxPixels() {
  constexpr int64_t kUsual = int64_t{1} << 27;
  const char* text = std::getenv("MVSTUDIO_MAX_MEGAPIXELS");
  const double megapixels = text ? std::atof(text) : 0;
  return megapixels > 0 && megapixels < 1e6 ? std::max<int64_t>(static_cast<int64_t>(megapixels * 1e6), 1) : kUsual;
}

ImageHeader ReadImageHeader(const std::string& path) {
  constexpr size_t kShort = 1 << 14, kLong = 1 << 20;
  CheckFileSize(path);
  std::string start = ReadPart(path, 0, kShort), end;
  if (start.size() == kShort && start.compare(1, 3, "PNG") == 0) {
    end = ReadPart(path, -std::streamoff{kShort}, kShort);
  } else if (start.size() == kShort) {
    start = ReadPart(path, 0, kLong);  // EXIF thumbnails and profiles come before a JPEG's size
  }
  const bool directory_later =
      start.size() == kLong && start.compare(1, 1, start, 0, 1) == 0 && (start[0] == 'I' || start[0] == 'M');
  if (directory_later) start = ReadFile(path);  // TIFF's may stand behind the pixels
  return internal::ParseImageHeader({start, end}, path);
}

Image ReadImage(const std::string& path, bool grey, bool as_stored) {
  Decoded file = Decode(path, grey ? cv::IMREAD_GRAYSCALE : cv::IMREAD_COLOR);
  if (!grey) cv::cvtColor(file.mat, file.mat, cv::COLOR_BGR2RGB);
  return as_stored ? FromMat(file.mat) : Rotated(FromMat(file.mat), file.header.turn);
}

Image ReadImageBytes(std::string bytes, const std::string& name) {
  Decoded file = Decode(std::move(bytes), name, cv::IMREAD_COLOR);
  cv::cvtColor(file.mat, file.mat, cv::COLOR_BGR2RGB);
  return FromMat(file.mat);
}

StretchedImage ReadImageStretched(const std::string& path, bool as_stored) {
  StretchedImage result;
  if (ReadImageHeader(path).bits <= 8) {
    result.rgb = ReadImage(path, false, as_stored);
    return result;
  }
  Decoded file = Decode(path, cv::IMREAD_COLOR | cv::IMREAD_ANYDEPTH);
  const double most = file.mat.depth() == CV_16U ? 65535 : file.mat.depth() == CV_8U ? 255 : 0;
  const auto [low, high] = UsedRange(file.mat);
  cv::Mat eight;
  if (most > 255 && 4 * (high - low) >= most) {
    file.mat.convertTo(eight, CV_8U, 1.0 / 257);
  } else {
    const double scale = 255 / std::max(1e-30, high - low);
    file.mat.convertTo(eight, CV_8U, scale, -low * scale);
    result.levels = static_cast<int>(std::min(high - low + 1, 65536.0)), result.of_levels = 65536;
  }
  cv::cvtColor(eight, eight, cv::COLOR_BGR2RGB);
  result.rgb = as_stored ? FromMat(eight) : Rotated(FromMat(eight), file.header.turn);
  return result;
}

Image ReadImageWithAlpha(const std::string& path) {
  const Decoded file = Decode(path, cv::IMREAD_UNCHANGED);
  if (file.mat.channels() != 4) return ReadImage(path);
  cv::Mat mat = file.mat;
  if (mat.depth() == CV_16U) mat.convertTo(mat, CV_8U, 1.0 / 257);
  cv::cvtColor(mat, mat, cv::COLOR_BGRA2RGBA);
  return Rotated(FromMat(mat), file.header.turn);
}

RawImage ReadRawImage(const std::string& path) {
  const Decoded file = Decode(path, cv::IMREAD_UNCHANGED);
  if (file.header.turn.any())
    throw FormatError(path, "orientation",
                      "asks for " + ToText(file.header.turn) + ": write the image turned, without the tag");
  RawImage raw;
  raw.width = file.mat.cols, raw.height = file.mat.rows, raw.channels = file.mat.channels();
  cv::Mat wide;
  file.mat.convertTo(wide, CV_16U);
  if (raw.channels >= 3) cv::cvtColor(wide, wide, raw.channels == 4 ? cv::COLOR_BGRA2RGBA : cv::COLOR_BGR2RGB);
  const size_t row = static_cast<size_t>(raw.width) * raw.channels;
  raw.values.resize(row * raw.height);
  for (int y = 0; y < raw.height; ++y) std::copy_n(wide.ptr<uint16_t>(y), row, raw.values.begin() + y * row);
  raw.most = file.mat.depth() == CV_16U ? 65535 : 255;
  if (raw.channels == 1 && file.header.codec == "png" && file.header.bits < 8) {  // the decoder spreads them over 0..255
    raw.most = (1 << file.header.bits) - 1;
    for (uint16_t& value : raw.values) value = static_cast<uint16_t>(value * raw.most / 255);
  }
  return raw;
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
