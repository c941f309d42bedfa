#include "dataset/footage/image_header.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstring>
#include <map>

#include "core/error.h"

namespace mvstudio::dataset::internal {
namespace {

using Bytes = const std::string&;

constexpr int64_t kMaxSide = 65535;

uint8_t At(Bytes b, size_t i) { return static_cast<uint8_t>(b[i]); }

uint32_t LittleEndian(Bytes b, size_t at, size_t size) {
  uint32_t value = 0;
  for (size_t i = 0; i < size; ++i) value |= uint32_t{At(b, at + i)} << (8 * i);
  return value;
}

bool StartsWith(Bytes b, const std::string& magic) { return b.compare(0, magic.size(), magic) == 0; }
bool IsPng(Bytes b) { return StartsWith(b, "\x89PNG\r\n\x1a\n"); }
bool IsJpeg(Bytes b) { return StartsWith(b, "\xff\xd8\xff"); }
bool IsTiff(Bytes b, size_t at = 0) {
  return b.size() >= at + 8 &&
         (b.compare(at, 4, std::string("II*\0", 4)) == 0 || b.compare(at, 4, std::string("MM\0*", 4)) == 0);
}
bool IsWebp(Bytes b) { return b.size() >= 30 && StartsWith(b, "RIFF") && b.compare(8, 4, "WEBP") == 0; }
/// PGM and PPM, as text (P2, P3) or binary (P5, P6).
bool IsPnm(Bytes b) { return b.size() > 2 && b[0] == 'P' && std::strchr("2356", b[1]) && std::isspace(At(b, 2)); }
bool IsBmp(Bytes b) { return b.size() >= 30 && StartsWith(b, "BM"); }

/// The first directory of TIFF's structure, which EXIF has too: a number and its place for each tag.
class TiffTags {
 public:
  struct Number {
    uint32_t value;
    size_t at, size;
  };

  /// The structure begins at byte `start`. What lies outside the bytes counts as absent.
  TiffTags(Bytes b, size_t start) : bytes_(b), big_endian_(start < b.size() && b[start] == 'M') {
    if (!IsTiff(b, start)) return;
    const size_t directory = start + Read(start + 4, 4);
    const size_t count = directory + 2 <= b.size() ? Read(directory, 2) : 0;
    for (size_t i = 0; i < count && directory + 14 + 12 * i <= b.size(); ++i) AddTag(start, directory + 2 + 12 * i);
  }
  const Number* Find(int tag) const {
    const auto found = numbers_.find(tag);
    return found == numbers_.end() ? nullptr : &found->second;
  }
  uint32_t Value(int tag, uint32_t fallback) const { return Find(tag) ? Find(tag)->value : fallback; }
  bool big_endian() const { return big_endian_; }

 private:
  void AddTag(size_t start, size_t entry) {
    const uint32_t type = Read(entry + 2, 2), count = Read(entry + 4, 4);
    const size_t size = type == 3 ? 2 : type == 4 ? 4 : 0;
    if (size == 0 || count == 0) return;
    const bool inside = count <= 4 / size;
    const size_t at = inside ? entry + 8 : start + Read(entry + 8, 4);
    if (at + size <= bytes_.size()) numbers_[static_cast<int>(Read(entry, 2))] = {Read(at, size), at, size};
  }
  uint32_t Read(size_t at, size_t size) const {
    if (at + size > bytes_.size()) return 0;
    if (!big_endian_) return LittleEndian(bytes_, at, size);
    uint32_t value = 0;
    for (size_t i = 0; i < size; ++i) value = value << 8 | At(bytes_, at + i);
    return value;
  }

  Bytes bytes_;
  bool big_endian_;
  std::map<int, Number> numbers_;
};

constexpr int kWidthTag = 256, kHeightTag = 257, kBitsTag = 258, kOrientationTag = 274, kSamplesTag = 277;

int OrientationAt(Bytes b, size_t start) {
  const uint32_t orientation = TiffTags(b, start).Value(kOrientationTag, 1);
  return orientation >= 1 && orientation <= 8 ? static_cast<int>(orientation) : 1;
}

/// Of the first sound chunk eXIf; 0: there is none.
int PngOrientation(Bytes b) {
  for (size_t at = b.find("eXIf"); at != std::string::npos; at = b.find("eXIf", at + 1)) {
    if (at < 4) continue;
    const size_t length = BigEndian32(b, at - 4);
    if (length > b.size() || at + 4 + length + 4 > b.size()) continue;
    if (Crc32(b, at, length + 4) == BigEndian32(b, at + 4 + length)) return OrientationAt(b, at + 4);
  }
  return 0;
}

ImageHeader PngHeader(const ImageBytes& bytes, const std::string& path) {
  Bytes b = bytes.start;
  if (b.size() < 33 || b.compare(12, 4, "IHDR") != 0) throw FormatError(path, "byte 8", "the PNG file has no header");
  ImageHeader header{BigEndian32(b, 16), BigEndian32(b, 20), 1, At(b, 24), "png", {}};
  const uint8_t colour = At(b, 25);
  header.channels = colour == 2 || colour == 3 ? 3 : colour == 4 ? 2 : colour == 6 ? 4 : 1;
  const int orientation = PngOrientation(b);
  header.turn = TurnOfOrientation(orientation > 0 ? orientation : PngOrientation(bytes.end));
  return header;
}

/// The first frame header (SOF0 … SOF15 without DHT, JPG, DAC), and EXIF's orientation before it.
ImageHeader JpegHeader(Bytes b, const std::string& path) {
  int orientation = 0;
  for (size_t at = 2; at + 9 < b.size() && At(b, at) == 0xff;) {
    const uint8_t marker = At(b, at + 1);
    if (marker == 0xff) {
      ++at;
      continue;
    }
    if (marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc) {
      const auto side = [&](size_t i) { return int64_t{At(b, i)} << 8 | At(b, i + 1); };
      return {side(at + 7), side(at + 5), At(b, at + 9), At(b, at + 4), "jpeg", TurnOfOrientation(orientation)};
    }
    if (marker == 0xe1 && orientation == 0 && b.compare(at + 4, 6, std::string("Exif\0\0", 6)) == 0) {
      orientation = OrientationAt(b, at + 10);
    }
    at += 2 + (size_t{At(b, at + 2)} << 8 | At(b, at + 3));
  }
  throw FormatError(path, "", "the JPEG file has no frame header; it ends early or is damaged");
}

ImageHeader TiffHeader(Bytes b, const std::string& path) {
  const TiffTags tags(b, 0);
  if (!tags.Find(kWidthTag) || !tags.Find(kHeightTag))
    throw FormatError(path, "", "the size of the TIFF file is not where it is looked for; save it as PNG");
  return {tags.Value(kWidthTag, 0),
          tags.Value(kHeightTag, 0),
          static_cast<int>(tags.Value(kSamplesTag, 1)),
          static_cast<int>(tags.Value(kBitsTag, 1)),
          "tiff",
          TurnOfOrientation(OrientationAt(b, 0))};
}

ImageHeader WebpHeader(Bytes b, const std::string& path) {
  const std::string kind = b.substr(12, 4);
  ImageHeader header{0, 0, 3, 8, "webp", {}};
  if (kind == "VP8 ") {
    header.width = LittleEndian(b, 26, 2) & 0x3fff, header.height = LittleEndian(b, 28, 2) & 0x3fff;
  } else if (kind == "VP8L") {
    const uint32_t packed = LittleEndian(b, 21, 4);
    header.width = (packed & 0x3fff) + 1, header.height = ((packed >> 14) & 0x3fff) + 1;
    header.channels = packed >> 28 & 1 ? 4 : 3;
  } else if (kind == "VP8X") {
    header.width = LittleEndian(b, 24, 3) + 1, header.height = LittleEndian(b, 27, 3) + 1;
    header.channels = At(b, 20) & 0x10 ? 4 : 3;
    if (At(b, 20) & 2) throw FormatError(path, "", "is an animated WebP file; give its frames as images");
  }
  for (size_t at = 12; at + 8 <= b.size();) {
    if (b.compare(at, 4, "EXIF") == 0) {
      const size_t start = at + 8 + (b.compare(at + 8, 4, "Exif") == 0 ? 6 : 0);
      header.turn = TurnOfOrientation(OrientationAt(b, start));
    }
    const size_t size = LittleEndian(b, at + 4, 4);
    at += 8 + size + size % 2;
  }
  return header;
}

ImageHeader BmpHeader(Bytes b) {
  const int bits = static_cast<int>(LittleEndian(b, 28, 2));
  const auto height = static_cast<int32_t>(LittleEndian(b, 22, 4));  // negative: rows from the top
  return {
      static_cast<int32_t>(LittleEndian(b, 18, 4)), height < 0 ? -int64_t{height} : height, bits == 32 ? 4 : 3, 8, "bmp", {}};
}

/// Width, height and the greatest value of a PGM or PPM file, numbers between blanks and comments, and where they end.
struct PnmNumbers {
  std::array<int64_t, 3> values = {0, 0, 0};
  size_t end = 0;
};

PnmNumbers ReadPnm(Bytes b, const std::string& path) {
  PnmNumbers numbers;
  size_t at = 2;
  for (int64_t& number : numbers.values) {
    while (at < b.size() && (std::isspace(At(b, at)) || b[at] == '#')) at = b[at] == '#' ? b.find('\n', at) : at + 1;
    const size_t begin = at;
    for (; at < b.size() && std::isdigit(At(b, at)) && at < begin + 9; ++at) number = 10 * number + (b[at] - '0');
    if (at == begin || number < 1) throw FormatError(path, "header", "the PGM or PPM file states no size and greatest value");
  }
  numbers.end = at;
  return numbers;
}

ImageHeader PnmHeader(Bytes b, const std::string& path) {
  const auto [width, height, most] = ReadPnm(b, path).values;
  if (most > 65535) throw FormatError(path, "header", "its greatest value is beyond 65535");
  return {width, height, b[1] == '3' || b[1] == '6' ? 3 : 1, most > 255 ? 16 : 8, "pnm", {}};
}

ImageHeader HeaderOf(const ImageBytes& bytes, const std::string& path) {
  if (IsPng(bytes.start)) return PngHeader(bytes, path);
  if (IsJpeg(bytes.start)) return JpegHeader(bytes.start, path);
  if (IsTiff(bytes.start)) return TiffHeader(bytes.start, path);
  if (IsWebp(bytes.start)) return WebpHeader(bytes.start, path);
  if (IsBmp(bytes.start)) return BmpHeader(bytes.start);
  if (IsPnm(bytes.start)) return PnmHeader(bytes.start, path);
  throw FormatError(path, "", "is neither PNG nor JPEG, TIFF, WebP, BMP, PGM or PPM");
}

}  // namespace

uint32_t BigEndian32(Bytes b, size_t i) {
  return uint32_t{At(b, i)} << 24 | uint32_t{At(b, i + 1)} << 16 | uint32_t{At(b, i + 2)} << 8 | uint32_t{At(b, i + 3)};
}

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

ImageHeader ParseImageHeader(const ImageBytes& bytes, const std::string& path) {
  ImageHeader header = HeaderOf(bytes, path);
  const std::string size = std::to_string(header.width) + "x" + std::to_string(header.height);
  if (header.width < 1 || header.height < 1) throw FormatError(path, "header", "an image of " + size + " pixels");
  if (header.width > kMaxSide || header.height > kMaxSide || header.width * header.height > MaxPixels()) {
    throw FormatError(path, "header",
                      "declares " + size + " pixels, more than the " + std::to_string(MaxPixels() >> 20) +
                          " Mi that are allowed; if it is sound, set MVSTUDIO_MAX_MEGAPIXELS");
  }
  if (header.turn.swaps_sides()) std::swap(header.width, header.height);
  return header;
}

void CheckPnm(Bytes b, const std::string& path) {
  if (b[1] != '5' && b[1] != '6') return;
  const auto [values, end] = ReadPnm(b, path);
  const int64_t needed = values[0] * values[1] * (b[1] == '6' ? 3 : 1) * (values[2] > 255 ? 2 : 1);
  if (static_cast<int64_t>(b.size()) - static_cast<int64_t>(end) - 1 < needed)
    throw FormatError(path, "byte " + std::to_string(b.size()), "the PGM or PPM file ends early; copy it again");
}

std::string WithoutTiffOrientation(std::string bytes) {
  const TiffTags tags(bytes, 0);
  const TiffTags::Number* const found = tags.Find(kOrientationTag);
  if (!found) return bytes;
  const size_t at = found->at, size = found->size, last = tags.big_endian() ? at + size - 1 : at;
  for (size_t i = 0; i < size; ++i) bytes[at + i] = 0;
  bytes[last] = 1;
  return bytes;
}

}  // namespace mvstudio::dataset::internal
