#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

/// Files that are made to break readers.
namespace mvstudio::testing {

using NamedText = std::pair<std::string, std::string>;

/// `text` with the last number that is a value (behind a blank, a comma, a colon or a bracket) replaced.
inline std::string WithNumber(const std::string& text, const std::string& number) {
  for (size_t begin = text.size() - 1; begin > 0; --begin) {
    const std::string first = "0123456789-", before = " ,:[\n";
    if (first.find(text[begin]) == std::string::npos || before.find(text[begin - 1]) == std::string::npos) continue;
    const size_t end = text.find_first_not_of("0123456789.eE+-", begin);
    return text.substr(0, begin) + number + (end == std::string::npos ? "" : text.substr(end));
  }
  return number;
}

inline std::string Repeated(const std::string& piece, size_t count) {
  std::string text;
  for (size_t i = 0; i < count; ++i) text += piece;
  return text;
}

/// Damaged forms of a valid JSON object; no reader may accept one.
inline std::vector<NamedText> HostileJson(const std::string& good) {
  const size_t brace = good.find('{');
  std::string bad_utf8 = good;
  bad_utf8.insert(good.find('"') + 1, "\xff\xfe\xc0\x80");
  std::string with_nul = good;
  with_nul.insert(good.size() / 2, 1, '\0');
  return {{"empty", ""},
          {"blank", " \n\t"},
          {"half", good.substr(0, good.size() / 2)},
          {"last-byte-missing", good.substr(0, good.find_last_of('}'))},
          {"deep-lists", std::string(100000, '[')},
          {"deep-closed-lists", std::string(100000, '[') + std::string(100000, ']')},
          {"deep-objects", Repeated("{\"a\":", 100000)},
          {"deep-inside", good.substr(0, brace + 1) + "\"deep\":" + std::string(100000, '[') + std::string(100000, ']') + "," +
                              good.substr(brace + 1)},
          {"too-large", WithNumber(good, "1e400")},
          {"many-digits", WithNumber(good, std::string(100000, '9'))},
          {"nan", WithNumber(good, "NaN")},
          {"infinity", WithNumber(good, "-Infinity")},
          {"not-utf8", bad_utf8},
          {"nul", with_nul},
          {"nothing-but-nul", std::string(1000, '\0')},
          {"another-type", "[1, 2, 3]"},
          {"null", "null"},
          {"escape-sequence", "{\"\x1b[2J\": 1}"},
          {"trailing", good + "}"}};
}

/// About 1 MB each: the last line, the first object's keys or all the text repeated.
inline std::vector<NamedText> LargeFiles(const std::string& good, bool json) {
  constexpr size_t kBytes = 1 << 20;
  if (json) {
    const size_t brace = good.find('{');
    std::string keys;
    for (size_t i = 0; keys.size() < kBytes; ++i) keys += "\"key" + std::to_string(i) + "\":0,";
    const auto inside = [&](const std::string& text) { return good.substr(0, brace + 1) + text + good.substr(brace + 1); };
    return {{"many keys", inside(keys)},
            {"many items", inside("\"more\":[0" + Repeated(",{}", kBytes / 3) + "],")},
            {"a long key", inside("\"" + std::string(kBytes, 'k') + "\":0,")}};
  }
  const size_t end = good.find_last_not_of("\r\n") + 1, begin = good.find_last_of('\n', end - 1) + 1;
  const std::string line = good.substr(begin, end - begin) + "\n";
  return {{"many lines", good.substr(0, begin) + Repeated(line, kBytes / line.size())},
          {"many times", Repeated(good + "\n", kBytes / (good.size() + 1))},
          {"a long line", good.substr(0, end) + std::string(kBytes, ' ') + good.substr(end)}};
}

/// Stored (not compressed) DEFLATE needs as many bytes as it makes; a run of one byte by fixed codes makes 258 bytes of 13
/// bits.
class ZeroDeflate {
 public:
  explicit ZeroDeflate(uint64_t count) {
    bytes_ = "\x78\x01";
    Bits(1, 1), Bits(1, 2);  // last block, fixed codes
    Bits(0x0c, 8);           // literal 0: code 00110000, most significant bit first
    for (uint64_t left = (count - 1) / 258; left > 0; --left) Bits(0xa3, 8), Bits(0, 5);  // length 258, distance 1
    Bits(0, 7);
    while (used_ != 0) Bits(0, 1);
    bytes_ += std::string("\0\0\0\1", 4);  // checksum: decoders find out after they have allocated
  }
  const std::string& bytes() const { return bytes_; }

 private:
  void Bits(unsigned value, int count) {
    for (int i = 0; i < count; ++i) {
      if (used_ == 0) bytes_ += '\0';
      bytes_.back() = static_cast<char>(static_cast<unsigned char>(bytes_.back()) | ((value >> i & 1) << used_));
      used_ = (used_ + 1) % 8;
    }
  }
  std::string bytes_;
  int used_ = 0;
};

inline std::string BigEndian32(uint32_t value) {
  std::string bytes;
  for (int shift = 24; shift >= 0; shift -= 8) bytes += static_cast<char>(value >> shift);
  return bytes;
}

inline std::string PngChunk(const std::string& type_and_data) {
  uint32_t crc = 0xffffffffu;
  for (const char byte : type_and_data) {
    crc ^= static_cast<uint8_t>(byte);
    for (int k = 0; k < 8; ++k) crc = crc & 1 ? 0xedb88320u ^ (crc >> 1) : crc >> 1;
  }
  return BigEndian32(static_cast<uint32_t>(type_and_data.size() - 4)) + type_and_data + BigEndian32(~crc);
}

inline std::string PngOf(uint32_t width, uint32_t height, bool rgb, const std::string& data) {
  const std::string header =
      "IHDR" + BigEndian32(width) + BigEndian32(height) + std::string{8, static_cast<char>(rgb ? 2 : 0), 0, 0, 0};
  return "\x89PNG\r\n\x1a\n" + PngChunk(header) + PngChunk("IDAT" + data) + PngChunk("IEND");
}

/// An RGB or grey PNG of zeros with right checksums of its chunks.
inline std::string ZeroPng(uint32_t width, uint32_t height, bool rgb) {
  const uint64_t row = uint64_t{width} * (rgb ? 3 : 1) + 1;
  return PngOf(width, height, rgb, ZeroDeflate(row * height).bytes());
}

/// A grey JPEG that promises width x height and ends after a few blocks.
inline std::string HollowJpeg(uint16_t width, uint16_t height) {
  const auto big16 = [](unsigned v) { return std::string{static_cast<char>(v >> 8), static_cast<char>(v)}; };
  std::string jpeg = "\xff\xd8\xff\xdb" + big16(67) + std::string(1, '\0') + std::string(64, '\1');
  jpeg += "\xff\xc0" + big16(11) + "\x08" + big16(height) + big16(width) + std::string{1, 1, 0x11, 0};
  for (const char table : {'\0', '\x10'}) {  // one code of one bit, which says: zero
    jpeg += "\xff\xc4" + big16(20) + table + std::string(1, '\1') + std::string(15, '\0') + std::string(1, '\0');
  }
  jpeg += "\xff\xda" + big16(8) + std::string{1, 1, 0, 0, 0x3f, 0};
  return jpeg + std::string(16, '\0') + "\xff\xd9";
}

/// Small files of images that need gigabytes.
inline std::vector<NamedText> ImageBombs() {
  return {{"grey-40000.png", ZeroPng(40000, 40000, false)},
          {"rgb-30000.png", ZeroPng(30000, 30000, true)},
          {"header-only.png", PngOf(0x7fffffff, 0x7fffffff, true, "")},
          {"hollow.jpg", HollowJpeg(65500, 65500)},
          {"hollow-30000.jpg", HollowJpeg(30000, 30000)}};
}

}  // namespace mvstudio::testing
