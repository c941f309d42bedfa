#include "avatar/data/safetensors_header.h"

#include <algorithm>
#include <cstring>
#include <limits>
#include <optional>

#include "core/error.h"
#include "core/hash/sha256.h"

namespace mvstudio::avatar::internal {
namespace {

struct TypeSize {
  const char* name;
  uint64_t bytes;
};
constexpr TypeSize kTypeSizes[] = {{"U8", 1},  {"I8", 1},   {"I16", 2}, {"I32", 4}, {"I64", 8},
                                   {"F16", 2}, {"BF16", 2}, {"F32", 4}, {"F64", 8}, {"BOOL", 1}};

std::string Quote(const std::string& text) {
  static const char* kHex = "0123456789abcdef";
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') {
      out += '\\', out += c;
    } else if (static_cast<unsigned char>(c) < 0x20) {
      out += "\\u00", out += kHex[(c >> 4) & 15], out += kHex[c & 15];
    } else {
      out += c;
    }
  }
  return out + "\"";
}

/// The part of JSON that the header may use: objects of objects, strings, arrays of unsigned integers. No recursion.
class HeaderParser {
 public:
  HeaderParser(std::string_view text, const std::string& path) : text_(text), path_(path) {}

  TensorHeader Parse() {
    TensorHeader header;
    ForEachMember("header", [&](const std::string& key) {
      if (key == "__metadata__") {
        ParseMetadata(&header.metadata);
      } else if (!header.entries.emplace(key, ParseEntry(key)).second) {
        Fail("tensor '" + key + "' appears twice");
      }
    });
    while (at_ < text_.size()) {
      if (text_[at_++] != ' ') Fail("unexpected text after the header");
    }
    return header;
  }

 private:
  [[noreturn]] void Fail(const std::string& what) const {
    throw FormatError(path_, "header byte " + std::to_string(at_), what);
  }

  void SkipSpace() {
    while (at_ < text_.size() && std::strchr(" \t\r\n", text_[at_]) && text_[at_] != '\0') ++at_;
  }
  bool Accept(char c) {
    SkipSpace();
    if (at_ >= text_.size() || text_[at_] != c) return false;
    ++at_;
    return true;
  }
  void Expect(char c) {
    if (!Accept(c)) Fail(std::string("expected '") + c + "'");
  }

  template <class Function>
  void ForEachMember(const std::string& what, Function member) {
    Expect('{');
    if (Accept('}')) return;
    do {
      SkipSpace();
      const std::string key = ParseString(what);
      Expect(':');
      member(key);
    } while (Accept(','));
    Expect('}');
  }

  void ParseMetadata(std::map<std::string, std::string>* metadata) {
    if (!metadata->empty()) Fail("__metadata__ appears twice");
    ForEachMember("__metadata__", [&](const std::string& key) {
      SkipSpace();
      if (!metadata->emplace(key, ParseString(key)).second) Fail("metadata '" + key + "' appears twice");
    });
  }

  TensorEntry ParseEntry(const std::string& name) {
    TensorEntry entry;
    int seen = 0;
    ForEachMember(name, [&](const std::string& key) {
      SkipSpace();
      if (key == "dtype" && !(seen & 1)) {
        entry.type = ParseString(key), seen |= 1;
      } else if (key == "shape" && !(seen & 2)) {
        for (const uint64_t size : ParseIntegers()) entry.shape.push_back(static_cast<int64_t>(size));
        seen |= 2;
      } else if (key == "data_offsets" && !(seen & 4)) {
        const std::vector<uint64_t> range = ParseIntegers();
        if (range.size() != 2) Fail("data_offsets of '" + name + "' must be two numbers");
        entry.begin = range[0], entry.end = range[1], seen |= 4;
      } else {
        Fail("unexpected or repeated '" + key + "' in tensor '" + name + "'");
      }
    });
    if (seen != 7) Fail("tensor '" + name + "' lacks dtype, shape or data_offsets");
    return entry;
  }

  std::vector<uint64_t> ParseIntegers() {
    std::vector<uint64_t> values;
    Expect('[');
    if (Accept(']')) return values;
    do {
      values.push_back(ParseInteger());
    } while (Accept(','));
    Expect(']');
    return values;
  }

  uint64_t ParseInteger() {
    SkipSpace();
    uint64_t value = 0;
    const size_t first = at_;
    for (; at_ < text_.size() && text_[at_] >= '0' && text_[at_] <= '9'; ++at_) {
      value = value * 10 + static_cast<uint64_t>(text_[at_] - '0');
      if (value > static_cast<uint64_t>(std::numeric_limits<int64_t>::max()) / 16) Fail("number too large");
    }
    if (at_ == first || (text_[first] == '0' && at_ - first > 1)) Fail("expected a number");
    return value;
  }

  std::string ParseString(const std::string& what) {
    if (at_ >= text_.size() || text_[at_] != '"') Fail("expected a string in " + what);
    std::string out;
    for (++at_; at_ < text_.size() && text_[at_] != '"'; ++at_) {
      const auto c = static_cast<unsigned char>(text_[at_]);
      if (c < 0x20) Fail("control character in a string");
      if (c == '\\') {
        ParseEscape(&out);
      } else {
        out += text_[at_];
      }
    }
    if (at_ >= text_.size()) Fail("string without an end");
    ++at_;
    return out;
  }

  void ParseEscape(std::string* out) {
    static const std::string kFrom = "\"\\/bfnrt", kTo = "\"\\/\b\f\n\r\t";
    if (++at_ >= text_.size()) Fail("string without an end");
    if (const size_t i = kFrom.find(text_[at_]); i != std::string::npos) {
      *out += kTo[i];
      return;
    }
    if (text_[at_] != 'u' || at_ + 4 >= text_.size()) Fail("unknown escape in a string");
    unsigned code = 0;
    for (int i = 0; i < 4; ++i) {
      const char c = text_[++at_];
      const bool digit = c >= '0' && c <= '9', letter = (c | 32) >= 'a' && (c | 32) <= 'f';
      if (!digit && !letter) Fail("bad \\u escape");
      code = code * 16 + static_cast<unsigned>(digit ? c - '0' : (c | 32) - 'a' + 10);
    }
    if (code >= 0xd800 && code < 0xe000) Fail("surrogates are not supported");
    if (code < 0x80) {
      *out += static_cast<char>(code);
    } else if (code < 0x800) {
      *out += static_cast<char>(0xc0 | (code >> 6)), *out += static_cast<char>(0x80 | (code & 63));
    } else {
      *out += static_cast<char>(0xe0 | (code >> 12)), *out += static_cast<char>(0x80 | ((code >> 6) & 63));
      *out += static_cast<char>(0x80 | (code & 63));
    }
  }

  std::string_view text_;
  const std::string& path_;
  size_t at_ = 0;
};

/// Bytes the shape needs; nothing on overflow.
std::optional<uint64_t> BytesOf(const TensorEntry& entry, uint64_t element_size) {
  uint64_t bytes = element_size;
  for (const int64_t size : entry.shape) {
    if (__builtin_mul_overflow(bytes, static_cast<uint64_t>(size), &bytes)) return std::nullopt;
  }
  return bytes;
}

std::string SplitOffDigests(const TensorHeader& header, std::map<std::string, std::string>* digests) {
  std::string header_digest;
  const std::string prefix = kDigestPrefix;
  for (const auto& [key, value] : header.metadata) {
    if (key == prefix) {
      header_digest = value;
    } else if (key.compare(0, prefix.size(), prefix) == 0) {
      (*digests)[key.substr(prefix.size())] = value;
    }
  }
  return header_digest;
}

void CheckHeaderDigest(TensorHeader header, std::string_view text, const std::string& digest, bool required,
                       const std::string& path) {
  if (digest.empty() && !required) return;
  if (digest.empty()) throw FormatError(path, "__metadata__", "has no digests: damaged, or not written by mvstudio");
  if (HeaderText(header) != text) throw FormatError(path, "", "the header is not as it was written: damaged file");
  header.metadata.erase(kDigestPrefix);
  if (DigestOfHeader(header) != digest)
    throw FormatError(path, "__metadata__", "the header does not match its digest: damaged file");
}

/// Data ranges sorted by position must follow each other without gaps and end where the file ends.
void CheckRanges(const TensorHeader& header, uint64_t data_size, const std::string& path) {
  std::vector<std::pair<std::pair<uint64_t, uint64_t>, std::string>> ranges;
  for (const auto& [name, entry] : header.entries) ranges.push_back({{entry.begin, entry.end}, name});
  std::sort(ranges.begin(), ranges.end());
  uint64_t expected = 0;
  for (const auto& [range, name] : ranges) {
    if (range.first != expected || range.second < range.first || range.second > data_size) {
      throw FormatError(path, name,
                        "data range [" + std::to_string(range.first) + ", " + std::to_string(range.second) +
                            ") leaves a gap, overlaps or ends beyond the file (" + std::to_string(data_size) +
                            " bytes of data): truncated or damaged file");
    }
    expected = range.second;
  }
  if (expected != data_size) throw FormatError(path, "", "the tensors end before the file does: damaged file");
}

void CheckShapes(const TensorHeader& header, const std::string& path) {
  for (const auto& [name, entry] : header.entries) {
    const uint64_t element_size = ElementSize(entry.type);
    if (element_size == 0) throw FormatError(path, name, "unknown type '" + entry.type + "'");
    const std::optional<uint64_t> bytes = BytesOf(entry, element_size);
    if (!bytes || *bytes != entry.end - entry.begin) throw FormatError(path, name, "its shape does not fit its data range");
  }
}

uint64_t HeaderSize(std::string_view content, const std::string& path) {
  if (content.size() < 8) throw FormatError(path, "", "too short for a safetensors file");
  uint64_t size = 0;
  for (int i = 0; i < 8; ++i) size |= static_cast<uint64_t>(static_cast<unsigned char>(content[i])) << (8 * i);
  if (size > kMaxHeaderBytes || size > content.size() - 8) {
    throw FormatError(path, "", "claims a header of " + std::to_string(size) + " bytes: not a safetensors file, or truncated");
  }
  return size;
}

}  // namespace

uint64_t ElementSize(const std::string& type) {
  for (const TypeSize& known : kTypeSizes) {
    if (type == known.name) return known.bytes;
  }
  return 0;
}

std::string DigestOfHeader(const TensorHeader& header) {
  Sha256 sha;
  const auto add = [&sha](const std::string& text) {
    const uint64_t size = text.size();
    sha.Update(&size, sizeof(size));
    sha.Update(text.data(), text.size());
  };
  for (const auto& [name, entry] : header.entries) {
    add(name), add(entry.type);
    for (const int64_t size : entry.shape) add(std::to_string(size));
    add(std::to_string(entry.begin)), add(std::to_string(entry.end));
  }
  add("metadata");
  for (const auto& [key, value] : header.metadata) add(key), add(value);
  return sha.HexDigest();
}

std::string HeaderText(const TensorHeader& header) {
  std::string text = "{\"__metadata__\":{";
  bool first = true;
  for (const auto& [key, value] : header.metadata) {
    text += (first ? "" : ",") + Quote(key) + ":" + Quote(value);
    first = false;
  }
  text += "}";
  for (const auto& [name, entry] : header.entries) {
    text += "," + Quote(name) + ":{\"dtype\":\"" + entry.type + "\",\"shape\":[";
    for (size_t i = 0; i < entry.shape.size(); ++i) text += (i ? "," : "") + std::to_string(entry.shape[i]);
    text += "],\"data_offsets\":[" + std::to_string(entry.begin) + "," + std::to_string(entry.end) + "]}";
  }
  text += "}";
  while (text.size() % 8) text += ' ';
  return text;
}

TensorLayout ParseTensorLayout(std::string_view content, bool require_digests, const std::string& path) {
  const uint64_t header_size = HeaderSize(content, path);
  const std::string_view text = content.substr(8, header_size);
  TensorLayout layout;
  layout.header = HeaderParser(text, path).Parse();
  layout.data_at = 8 + header_size;
  CheckRanges(layout.header, content.size() - layout.data_at, path);
  CheckShapes(layout.header, path);
  const std::string header_digest = SplitOffDigests(layout.header, &layout.digests);
  CheckHeaderDigest(layout.header, text, header_digest, require_digests, path);
  return layout;
}

}  // namespace mvstudio::avatar::internal
