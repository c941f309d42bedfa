#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

/// The header and the parameter section of C3D files (ReadC3dMarkers names the source).
namespace mvstudio::dataset::internal {

/// Numbers at places of a file's bytes, in the byte order of its processor.
class C3dBytes {
 public:
  enum class Processor { kIntel = 84, kDec = 85, kMips = 86 };

  C3dBytes(std::string_view bytes, Processor processor) : bytes_(bytes), processor_(processor) {}
  size_t size() const { return bytes_.size(); }
  /// 0 beyond the end.
  uint8_t Byte(size_t at) const { return at < bytes_.size() ? static_cast<uint8_t>(bytes_[at]) : uint8_t{0}; }
  uint16_t Word(size_t at) const;
  int16_t Int(size_t at) const { return static_cast<int16_t>(Word(at)); }
  /// IEEE single precision, or DEC's F format: a fraction in [0.5, 1) and an exponent with bias 128.
  double Float(size_t at) const;
  /// Without blanks and zero bytes at the end.
  std::string Text(size_t at, size_t length) const;

 private:
  std::string_view bytes_;
  Processor processor_;
};

struct C3dParameter {
  int type = 0;  ///< -1: text, 1: bytes, 2: 16-bit integers, 4: floats
  std::vector<size_t> dims;
  size_t at = 0;  ///< place of the data
};

/// Parameters by "GROUP:NAME".
class C3dParameters {
 public:
  /// Throws FormatError for a section that is damaged or not there.
  C3dParameters(const std::string& path, std::string_view file);

  const C3dBytes& bytes() const { return bytes_; }
  /// Place of the section in the file.
  size_t begin() const { return begin_; }
  bool Has(const std::string& name) const { return table_.count(name) > 0; }
  /// The number at an index; `missing` where there is none.
  double Number(const std::string& name, size_t index, double missing) const;
  /// A text, or a list of texts of one length.
  std::vector<std::string> Texts(const std::string& name) const;

 private:
  void ReadEntries(const std::string& path, size_t begin, size_t end);

  C3dBytes bytes_;
  size_t begin_ = 0;
  std::map<std::string, C3dParameter> table_;
};

}  // namespace mvstudio::dataset::internal
