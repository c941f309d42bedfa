#include "exports/npy.h"

#include <algorithm>
#include <array>
#include <cstring>

#include "core/check.h"
#include "core/error.h"
#include "core/join.h"

namespace mvstudio::exports {
namespace {

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

/// Magic, version and the header padded so that the data start at a multiple of 64.
std::string NpyHeader(const std::string& descr, const std::vector<size_t>& shape) {
  std::string header = "{'descr': '" + descr + "', 'fortran_order': False, 'shape': " + ShapeText(shape) + ", }";
  constexpr size_t kPrefix = 10;
  header.append(63 - (kPrefix + header.size()) % 64, ' ');
  header += '\n';
  std::string bytes("\x93NUMPY\x01\x00", 8);
  Append<uint16_t>(static_cast<uint16_t>(header.size()), &bytes);
  return bytes + header;
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

// Pickle opcodes (Python's pickletools), protocol 3.

std::string Unicode(const std::string& utf8) {
  std::string bytes = "X";
  Append<uint32_t>(static_cast<uint32_t>(utf8.size()), &bytes);
  return bytes + utf8;
}

std::string Int(int value) {
  std::string bytes = "J";
  Append<int32_t>(value, &bytes);
  return bytes;
}

std::string Global(const std::string& module, const std::string& name) { return "c" + module + "\n" + name + "\n"; }

const char kFalse = '\x89', kTrue = '\x88', kTuple1 = '\x85', kTuple3 = '\x87';

/// numpy.dtype(kind) with the state that numpy gives it.
std::string Dtype(const std::string& kind, const std::string& order, int flags) {
  std::string bytes = Global("numpy", "dtype") + Unicode(kind) + kFalse + kTrue + kTuple3 + "R";
  bytes += "(" + Int(3) + Unicode(order) + "NNN" + Int(-1) + Int(-1) + Int(flags) + "tb";
  return bytes;
}

/// _reconstruct(ndarray, (0,), b'b') followed by its state (1, shape, dtype, False, data).
std::string Ndarray(const std::vector<size_t>& shape, const std::string& dtype, const std::string& data) {
  std::string bytes = Global("numpy.core.multiarray", "_reconstruct") + Global("numpy", "ndarray") + Int(0) + kTuple1 +
                      std::string("C\x01", 2) + "b" + kTuple3 + "R";
  bytes += "(" + Int(1) + "(";
  for (const size_t n : shape) bytes += Int(static_cast<int>(n));
  bytes += "t" + dtype + kFalse + data + "tb";
  return bytes;
}

}  // namespace

std::string NpyOfDoubles(const std::vector<size_t>& shape, const std::vector<double>& values) {
  return NpyOf("<f8", shape, values);
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
  std::string bytes, directory;
  for (const auto& [stem, content] : members) {
    if (bytes.size() + content.size() > 0xfff00000u) throw UsageError(".npz: more than 4 GiB; choose fewer option 'frames'");
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

PyValue PyValue::Text(const std::string& utf8) {
  PyValue value;
  value.opcodes_ = Unicode(utf8);
  return value;
}

PyValue PyValue::List(const std::vector<PyValue>& items) {
  PyValue value;
  value.opcodes_ = "](";
  for (const PyValue& item : items) value.opcodes_ += item.opcodes_;
  value.opcodes_ += "e";
  return value;
}

PyValue PyValue::Dict(const std::vector<std::pair<std::string, PyValue>>& items) {
  PyValue value;
  value.opcodes_ = "}(";
  for (const auto& [key, item] : items) value.opcodes_ += Unicode(key) + item.opcodes_;
  value.opcodes_ += "u";
  return value;
}

PyValue PyValue::Array(const std::vector<size_t>& shape, const std::vector<double>& values) {
  MVS_CHECK(Product(shape) == values.size(), values.size() << " values for the shape " << ShapeText(shape));
  std::string data = "B";
  Append<uint32_t>(static_cast<uint32_t>(values.size() * sizeof(double)), &data);
  data.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(double));
  PyValue value;
  value.opcodes_ = Ndarray(shape, Dtype("f8", "<", 0), data);
  return value;
}

std::string PyValue::ToNpy() const {
  constexpr int kObjectFlags = 63;  // what numpy's object dtype carries
  const std::string objects = "](" + opcodes_ + "e";
  return NpyHeader("|O", {}) + std::string("\x80\x03", 2) + Ndarray({}, Dtype("O8", "|", kObjectFlags), objects) + ".";
}

}  // namespace mvstudio::exports
