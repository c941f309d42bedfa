#include "dataset/pose/c3d_parameters.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "core/error.h"

namespace mvstudio::dataset::internal {
namespace {

constexpr size_t kBlock = 512;
constexpr uint8_t kSignature = 0x50;

/// Place of the parameter section. Throws for other files.
size_t SectionOf(const std::string& path, std::string_view file) {
  const C3dBytes bytes(file, C3dBytes::Processor::kIntel);
  if (file.size() < kBlock || bytes.Byte(1) != kSignature) {
    throw FormatError(path, "header", "is no C3D file: its second byte is not 0x50; was it renamed, or cut off?");
  }
  const size_t at = bytes.Byte(0) == 0 ? file.size() : (bytes.Byte(0) - size_t{1}) * kBlock;
  if (at == 0 || at + 4 > file.size())
    throw FormatError(path, "header", "the parameter section is beyond the file's end; it is cut off");
  return at;
}

C3dBytes::Processor ProcessorOf(const std::string& path, std::string_view file) {
  const int number = static_cast<uint8_t>(file[SectionOf(path, file) + 3]);
  if (number >= 84 && number <= 86) return static_cast<C3dBytes::Processor>(number);
  throw FormatError(
      path, "parameters",
      "processor type " + std::to_string(number) + " is none of Intel (84), DEC (85), MIPS (86); the file is damaged");
}

size_t Count(const C3dParameter& parameter, size_t first_dim) {
  size_t count = 1;
  for (size_t k = first_dim; k < parameter.dims.size(); ++k) count *= parameter.dims[k];  // at most 7 of 255
  return count;
}

}  // namespace

uint16_t C3dBytes::Word(size_t at) const {
  const uint8_t a = Byte(at), b = Byte(at + 1);
  return processor_ == Processor::kMips ? static_cast<uint16_t>(a << 8 | b) : static_cast<uint16_t>(b << 8 | a);
}

double C3dBytes::Float(size_t at) const {
  const uint32_t first = Word(at), second = Word(at + 2);
  // Intel stores the low half first; DEC and MIPS the high half.
  const uint32_t bits = processor_ == Processor::kIntel ? second << 16 | first : first << 16 | second;
  if (processor_ == Processor::kDec) {
    const int exponent = static_cast<int>(bits >> 23 & 0xff);
    const double fraction = 0.5 + (bits & 0x7fffff) / 16777216.0, sign = bits >> 31 ? -1 : 1;
    return exponent == 0 ? 0 : std::ldexp(sign * fraction, exponent - 128);
  }
  float value = 0;
  std::memcpy(&value, &bits, sizeof(value));
  return value;
}

std::string C3dBytes::Text(size_t at, size_t length) const {
  std::string text;
  for (size_t i = at; i < at + length && i < size(); ++i) text += static_cast<char>(Byte(i));
  while (!text.empty() && (text.back() == ' ' || text.back() == '\0')) text.pop_back();
  return text;
}

C3dParameters::C3dParameters(const std::string& path, std::string_view file) : bytes_(file, ProcessorOf(path, file)) {
  const size_t begin = begin_ = SectionOf(path, file);
  const size_t blocks = bytes_.Byte(begin + 2);
  // Some programs leave the number of blocks at 0; then the entries' own end counts.
  ReadEntries(path, begin + 4, blocks == 0 ? file.size() : std::min(file.size(), begin + blocks * kBlock));
}

void C3dParameters::ReadEntries(const std::string& path, size_t begin, size_t end) {
  std::map<int, std::string> groups;
  std::vector<std::pair<int, std::pair<std::string, C3dParameter>>> entries;
  for (size_t at = begin; at + 2 < end;) {
    const size_t length = static_cast<size_t>(std::abs(static_cast<int8_t>(bytes_.Byte(at))));
    const int group = static_cast<int8_t>(bytes_.Byte(at + 1));
    if (length == 0 || group == 0) break;
    const size_t next_at = at + 2 + length, step = bytes_.Word(next_at);
    const std::string name = bytes_.Text(at + 2, length);
    if (next_at + 2 > end) throw FormatError(path, "parameter " + std::to_string(entries.size()), "is cut off");
    if (group < 0) {
      groups[-group] = name;
    } else {
      C3dParameter parameter{static_cast<int8_t>(bytes_.Byte(next_at + 2)), {}, 0};
      const size_t num_dims = bytes_.Byte(next_at + 3);
      if (num_dims > 7)
        throw FormatError(path, "parameter " + name, "has " + std::to_string(num_dims) + " dimensions; damaged");
      for (size_t k = 0; k < num_dims; ++k) parameter.dims.push_back(bytes_.Byte(next_at + 4 + k));
      parameter.at = next_at + 4 + num_dims;
      const size_t width = static_cast<size_t>(std::abs(parameter.type));
      if (Count(parameter, 0) > end || parameter.at + width * Count(parameter, 0) > end) {
        throw FormatError(path, "parameter " + name, "is longer than the parameter section; the file is damaged");
      }
      entries.push_back({group, {name, std::move(parameter)}});
    }
    if (step == 0) break;
    at = next_at + step;
  }
  for (auto& [group, entry] : entries) table_[groups[group] + ":" + entry.first] = std::move(entry.second);
}

double C3dParameters::Number(const std::string& name, size_t index, double missing) const {
  const auto found = table_.find(name);
  if (found == table_.end() || index >= Count(found->second, 0)) return missing;
  const C3dParameter& parameter = found->second;
  if (parameter.type == 4) return bytes_.Float(parameter.at + 4 * index);
  if (parameter.type == 2) return bytes_.Word(parameter.at + 2 * index);  // counts are used beyond 32767
  return parameter.type == 1 ? bytes_.Byte(parameter.at + index) : missing;
}

std::vector<std::string> C3dParameters::Texts(const std::string& name) const {
  const auto found = table_.find(name);
  std::vector<std::string> texts;
  if (found == table_.end() || found->second.type != -1) return texts;
  const C3dParameter& parameter = found->second;
  const size_t length = parameter.dims.empty() ? 1 : parameter.dims[0];
  for (size_t i = 0; i < Count(parameter, 1); ++i) texts.push_back(bytes_.Text(parameter.at + i * length, length));
  return texts;
}

}  // namespace mvstudio::dataset::internal
