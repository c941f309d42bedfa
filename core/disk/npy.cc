#include "core/disk/npy.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>

#include "core/disk/files.h"
#include "core/error.h"

namespace mvstudio {
namespace {

constexpr size_t kMaxHeaderBytes = 1 << 16;
constexpr size_t kMaxTextLength = 1 << 16;
constexpr int kMaxDimensions = 32;

uint32_t LittleEndian(const std::string& bytes, size_t at, int count) {
  uint32_t value = 0;
  for (int i = count; i-- > 0;) value = value << 8 | static_cast<unsigned char>(bytes[at + static_cast<size_t>(i)]);
  return value;
}

/// The text after `'key':` of the header's Python dict, without leading blanks.
std::string AfterKey(const std::string& header, const std::string& key, const std::string& path) {
  const size_t at = header.find("'" + key + "'");
  const size_t colon = at == std::string::npos ? at : header.find(':', at);
  const size_t first = colon == std::string::npos ? colon : header.find_first_not_of(" \t", colon + 1);
  if (first == std::string::npos) throw FormatError(path, "header", "has no '" + key + "'");
  return header.substr(first);
}

struct HeaderText {
  std::string text;
  size_t end = 0;  ///< where the data begin
};

HeaderText FindHeader(const std::string& bytes, const std::string& path) {
  if (bytes.size() < 10 || bytes.compare(0, 6, "\x93NUMPY") != 0) throw FormatError(path, "byte 0", "is not a .npy file");
  const int version = static_cast<unsigned char>(bytes[6]), length_bytes = version == 1 ? 2 : 4;
  if (version < 1 || version > 3) throw FormatError(path, "byte 6", "version " + std::to_string(version) + " is not known");
  if (bytes.size() < 12) throw FormatError(path, "header", "is cut short");
  const size_t length = LittleEndian(bytes, 8, length_bytes), begin = 8 + static_cast<size_t>(length_bytes);
  if (length > kMaxHeaderBytes || begin + length > bytes.size())
    throw FormatError(path, "header", "is cut short or absurdly long");
  return {bytes.substr(begin, length), begin + length};
}

struct Header {
  std::string type;  ///< "f4", "i8", …
  bool fortran = false;
  std::vector<int64_t> shape;
};

std::vector<int64_t> ParseShape(const std::string& text, const std::string& path) {
  const size_t close = text.find(')');
  if (text.empty() || text[0] != '(' || close == std::string::npos) throw FormatError(path, "shape", "is not a tuple");
  std::vector<int64_t> shape;
  int64_t value = -1;
  for (size_t i = 1; i <= close; ++i) {
    const char c = text[i];
    if (c >= '0' && c <= '9') {
      value = std::max<int64_t>(value, 0) * 10 + (c - '0');
      if (value > (int64_t{1} << 40)) throw FormatError(path, "shape", "is absurd");
    } else if (c == ',' || c == ')') {
      if (value >= 0) shape.push_back(value);
      value = -1;
    } else if (c != ' ') {
      throw FormatError(path, "shape", "holds something else than numbers");
    }
  }
  if (shape.size() > kMaxDimensions) throw FormatError(path, "shape", "has more than 32 dimensions");
  return shape;
}

Header ParseHeader(const std::string& text, const std::string& path) {
  Header header;
  const std::string descr = AfterKey(text, "descr", path);
  if (descr.size() < 5 || descr[0] != '\'' || descr[4] != '\'' || (descr[1] != '<' && descr[1] != '|' && descr[1] != '='))
    throw FormatError(path, "descr", "is not a plain little-endian number type (objects and records are not read)");
  header.type = descr.substr(2, 2);
  header.fortran = AfterKey(text, "fortran_order", path).rfind("True", 0) == 0;
  header.shape = ParseShape(AfterKey(text, "shape", path), path);
  return header;
}

double HalfToDouble(uint16_t half) {
  const int exponent = half >> 10 & 0x1f, mantissa = half & 0x3ff;
  const double sign = half & 0x8000 ? -1 : 1;
  if (exponent == 31) return mantissa ? std::nan("") : sign * INFINITY;
  return sign * (exponent ? std::ldexp(1024 + mantissa, exponent - 25) : std::ldexp(mantissa, -24));
}

template <class T>
double NumberAt(const char* at) {
  T value;
  std::memcpy(&value, at, sizeof(T));
  return static_cast<double>(value);
}

using Reader = double (*)(const char*);
Reader ReaderOf(const std::string& type, size_t* bytes) {
  *bytes = static_cast<size_t>(type[1] - '0');
  if (type == "f2") return [](const char* at) { return HalfToDouble(static_cast<uint16_t>(NumberAt<uint16_t>(at))); };
  if (type == "f4") return NumberAt<float>;
  if (type == "f8") return NumberAt<double>;
  if (type == "i1") return NumberAt<int8_t>;
  if (type == "i2") return NumberAt<int16_t>;
  if (type == "i4") return NumberAt<int32_t>;
  if (type == "i8") return NumberAt<int64_t>;
  if (type == "u1" || type == "b1") return NumberAt<uint8_t>;
  if (type == "u2") return NumberAt<uint16_t>;
  if (type == "u4") return NumberAt<uint32_t>;
  if (type == "u8") return NumberAt<uint64_t>;
  return nullptr;
}

/// Elements of an array; throws FormatError where they are more than the file holds.
size_t NumElements(const std::vector<int64_t>& shape, size_t held, const std::string& path) {
  size_t count = std::count(shape.begin(), shape.end(), 0) > 0 ? 0 : 1;
  for (const int64_t size : shape) {
    if (size > 0 && count > held / static_cast<size_t>(size))
      throw FormatError(path, "shape", "promises more than the file holds");
    count *= static_cast<size_t>(size);
  }
  if (count > held) throw FormatError(path, "shape", "promises more than the file holds");
  return count;
}

/// Characters of an element of `<U…`.
size_t TextLength(const std::string& descr, const std::string& path) {
  size_t length = 0, at = 3;
  if (descr.rfind("'<U", 0) == 0 || descr.rfind("'=U", 0) == 0) {
    for (; at < descr.size() && descr[at] >= '0' && descr[at] <= '9' && length <= kMaxTextLength; ++at)
      length = length * 10 + static_cast<size_t>(descr[at] - '0');
  }
  if (at == 3 || at >= descr.size() || descr[at] != '\'') throw FormatError(path, "descr", "is not little-endian text");
  if (length > kMaxTextLength) throw FormatError(path, "descr", "texts are longer than " + std::to_string(kMaxTextLength));
  return length;
}

void AppendUtf8(uint32_t point, const std::string& path, std::string* text) {
  if (point > 0x10ffff || (point >= 0xd800 && point < 0xe000)) throw FormatError(path, "text", "holds what is no character");
  const int more = point < 0x80 ? 0 : point < 0x800 ? 1 : point < 0x10000 ? 2 : 3;
  constexpr uint32_t kLead[] = {0, 0xc0, 0xe0, 0xf0};
  *text += static_cast<char>(kLead[more] | point >> (6 * more));
  for (int k = more; k-- > 0;) *text += static_cast<char>(0x80 | (point >> (6 * k) & 0x3f));
}

/// An element of `length` characters without the NULs that fill it up.
std::string TextAt(const std::string& bytes, size_t at, size_t length, const std::string& path) {
  std::string text;
  while (length > 0 && LittleEndian(bytes, at + 4 * (length - 1), 4) == 0) --length;
  for (size_t i = 0; i < length; ++i) AppendUtf8(LittleEndian(bytes, at + 4 * i, 4), path, &text);
  return text;
}

/// Position in the file of the element that is `index` in C order.
int64_t FortranPosition(int64_t index, const std::vector<int64_t>& shape) {
  int64_t position = 0;
  std::vector<int64_t> place(shape.size());
  for (size_t d = shape.size(); d-- > 0;) place[d] = index % shape[d], index /= shape[d];
  for (size_t d = shape.size(); d-- > 0;) position = position * shape[d] + place[d];
  return position;
}

}  // namespace

NpyArray ParseNpy(const std::string& bytes, const std::string& path) {
  const HeaderText found = FindHeader(bytes, path);
  const Header header = ParseHeader(found.text, path);
  size_t item = 0;
  const Reader reader = ReaderOf(header.type, &item);
  if (!reader) throw FormatError(path, "descr", "type '" + header.type + "' is not a number that can be read");
  NpyArray array{header.shape, {}};
  const size_t count = NumElements(header.shape, (bytes.size() - found.end) / item, path);
  array.values.resize(count);
  const char* first = bytes.data() + found.end;
  for (size_t i = 0; i < count; ++i) {
    const size_t at = header.fortran ? static_cast<size_t>(FortranPosition(static_cast<int64_t>(i), header.shape)) : i;
    array.values[i] = reader(first + at * item);
  }
  return array;
}

std::vector<std::string> ParseNpyTexts(const std::string& bytes, const std::string& path) {
  const HeaderText found = FindHeader(bytes, path);
  const size_t length = TextLength(AfterKey(found.text, "descr", path), path);
  const std::vector<int64_t> shape = ParseShape(AfterKey(found.text, "shape", path), path);
  if (shape.size() != 1) throw FormatError(path, "shape", "is not that of a list of texts");
  if (length == 0 && shape[0] > 0) throw FormatError(path, "descr", "texts have no characters");
  const size_t count = length == 0 ? 0 : NumElements(shape, (bytes.size() - found.end) / (4 * length), path);
  std::vector<std::string> texts;
  for (size_t i = 0; i < count; ++i) texts.push_back(TextAt(bytes, found.end + 4 * length * i, length, path));
  return texts;
}

std::optional<uint64_t> NpyFileBytes(const std::string& head) {
  constexpr double kMost = 1e18;
  try {
    const HeaderText found = FindHeader(head, "");
    const std::string descr = AfterKey(found.text, "descr", "");
    unsigned width = 0;
    char type = 0, order = 0;
    if (std::sscanf(descr.c_str(), "'%c%c%8u'", &order, &type, &width) != 3 || type == 'O') return std::nullopt;
    double bytes = width * (type == 'U' ? 4.0 : 1.0);
    for (const int64_t size : ParseShape(AfterKey(found.text, "shape", ""), "")) bytes *= static_cast<double>(size);
    return found.end + static_cast<uint64_t>(std::min(bytes, kMost));
  } catch (const FormatError&) {
    return std::nullopt;
  }
}

NpyArray ReadNpy(const std::string& path) { return ParseNpy(ReadFile(path), path); }

}  // namespace mvstudio
