#include "core/disk/npy_write.h"

#include <algorithm>
#include <array>
#include <cstring>

#include "core/check.h"
#include "core/error.h"
#include "core/join.h"

namespace mvstudio {
namespace {

constexpr size_t kMaxMembers = 0xffff;

template <class T>
void Append(T value, std::string* bytes) {
  char raw[sizeof(T)];
  std::memcpy(raw, &value, sizeof(T));
  bytes->append(raw, sizeof(T));
}

size_t Product(const std::vector<size_t>& shape) {
  size_t count = 1;
  for (const size_t n : shape) count *= n;
  return count;
}

/// `(3,)`, `(2, 3)`, `()`.
std::string ShapeText(const std::vector<size_t>& shape) {
  return "(" + Join(shape, ", ", [](size_t size) { return std::to_string(size); }) + (shape.size() == 1 ? ",)" : ")");
}

template <class T>
std::string NpyOf(const std::string& descr, const std::vector<size_t>& shape, const std::vector<T>& values) {
  MVS_CHECK(Product(shape) == values.size(), values.size() << " values for the shape " << ShapeText(shape));
  std::string bytes = NpyHeader(descr, shape);
  bytes.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
  return bytes;
}

/// Code points of UTF-8 text; throws UsageError where it is none.
std::vector<uint32_t> CodePoints(const std::string& text) {
  std::vector<uint32_t> points;
  for (size_t i = 0; i < text.size();) {
    const auto byte = static_cast<uint8_t>(text[i]);
    const size_t length = byte < 0x80 ? 1 : byte >> 5 == 6 ? 2 : byte >> 4 == 14 ? 3 : byte >> 3 == 30 ? 4 : 0;
    if (length == 0 || i + length > text.size()) throw UsageError("a name is not UTF-8 text");
    uint32_t point = length == 1 ? byte : byte & (0x7fu >> length);
    for (size_t k = 1; k < length; ++k) {
      const auto next = static_cast<uint8_t>(text[i + k]);
      if (next >> 6 != 2) throw UsageError("a name is not UTF-8 text");
      point = point << 6 | (next & 0x3fu);
    }
    points.push_back(point);
    i += length;
  }
  return points;
}

uint32_t Crc32(const std::string& bytes) {
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
  for (const char byte : bytes) crc = table[(crc ^ static_cast<uint8_t>(byte)) & 0xff] ^ (crc >> 8);
  return ~crc;
}

/// What a member's local and central headers share, from "version needed" to "extra length". 1980-01-01: same input, same
/// bytes.
std::string ZipCommon(const std::string& name, const std::string& content) {
  std::string bytes;
  Append<uint16_t>(20, &bytes);
  Append<uint16_t>(0, &bytes);
  Append<uint16_t>(0, &bytes);  // stored
  Append<uint16_t>(0, &bytes);
  Append<uint16_t>(0x21, &bytes);
  Append<uint32_t>(Crc32(content), &bytes);
  Append<uint32_t>(static_cast<uint32_t>(content.size()), &bytes);
  Append<uint32_t>(static_cast<uint32_t>(content.size()), &bytes);
  Append<uint16_t>(static_cast<uint16_t>(name.size()), &bytes);
  Append<uint16_t>(0, &bytes);
  return bytes;
}

}  // namespace

std::string NpyHeader(const std::string& descr, const std::vector<size_t>& shape) {
  std::string header = "{'descr': '" + descr + "', 'fortran_order': False, 'shape': " + ShapeText(shape) + ", }";
  constexpr size_t kPrefix = 10;
  header.append(63 - (kPrefix + header.size()) % 64, ' ');
  header += '\n';
  std::string bytes("\x93NUMPY\x01\x00", 8);
  Append<uint16_t>(static_cast<uint16_t>(header.size()), &bytes);
  return bytes + header;
}

std::string NpyOfDoubles(const std::vector<size_t>& shape, const std::vector<double>& values) {
  return NpyOf("<f8", shape, values);
}

std::string NpyOfFloats(const std::vector<size_t>& shape, const std::vector<float>& values) {
  return NpyOf("<f4", shape, values);
}

std::string NpyOfInts(const std::vector<size_t>& shape, const std::vector<int64_t>& values) {
  return NpyOf("<i8", shape, values);
}

std::string NpyOfTexts(const std::vector<std::string>& texts) {
  std::vector<std::vector<uint32_t>> all;
  size_t longest = 1;
  for (const std::string& text : texts) {
    all.push_back(CodePoints(text));
    longest = std::max(longest, all.back().size());
  }
  std::string bytes = NpyHeader("<U" + std::to_string(longest), {texts.size()});
  for (const auto& points : all) {
    for (size_t i = 0; i < longest; ++i) Append<uint32_t>(i < points.size() ? points[i] : 0, &bytes);
  }
  return bytes;
}

std::string NpzOf(const std::vector<std::pair<std::string, std::string>>& members) {
  if (members.size() > kMaxMembers) throw UsageError(".npz: more than 65,535 arrays");
  std::string bytes, directory;
  for (const auto& [stem, content] : members) {
    if (bytes.size() + content.size() > 0xfff00000u) throw UsageError(".npz: more than 4 GiB; choose fewer frames");
    const std::string name = stem + ".npy", common = ZipCommon(name, content);
    directory += "PK\x01\x02";
    Append<uint16_t>(20, &directory);
    directory += common;
    Append<uint16_t>(0, &directory);  // comment
    Append<uint16_t>(0, &directory);  // disk
    Append<uint16_t>(0, &directory);
    Append<uint32_t>(0, &directory);
    Append<uint32_t>(static_cast<uint32_t>(bytes.size()), &directory);
    directory += name;
    bytes += "PK\x03\x04" + common + name + content;
  }
  std::string end = "PK\x05\x06";
  Append<uint32_t>(0, &end);
  Append<uint16_t>(static_cast<uint16_t>(members.size()), &end);
  Append<uint16_t>(static_cast<uint16_t>(members.size()), &end);
  Append<uint32_t>(static_cast<uint32_t>(directory.size()), &end);
  Append<uint32_t>(static_cast<uint32_t>(bytes.size()), &end);
  Append<uint16_t>(0, &end);
  return bytes + directory + end;
}

}  // namespace mvstudio
