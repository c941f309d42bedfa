#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"

/// Checked access to JSON files; included by .cc files of this module only.
namespace mvstudio::dataset::internal {

using Json = nlohmann::ordered_json;

/// Parses a text. Refused: nesting deeper than 64, a key twice in one object, numbers beyond the range of doubles, bytes that
/// are not UTF-8. "-0" keeps its sign. Throws FormatError with `path` and the byte where the text breaks, or the place of the
/// key.
Json ParseJson(std::string_view text, const std::string& path);

constexpr int64_t kMaxJsonBytes = int64_t{256} << 20;
/// The same for a regular file of at most `max_bytes`. Throws IoError, FormatError.
Json ParseJsonFile(const std::string& path, int64_t max_bytes = kMaxJsonBytes);
/// Content of a regular file of at most `max_bytes`. Throws IoError, FormatError.
std::string ReadTextFile(const std::string& path, int64_t max_bytes);

/// A value and where it stands, for messages such as `calibration.json: cameras[3].K[1][2]: must be a number`.
class JsonView {
 public:
  JsonView(const std::string& path, const Json& value, std::string where = "")
      : path_(&path), value_(&value), where_(std::move(where)) {}

  JsonView operator[](const char* key) const;
  JsonView operator[](size_t idx) const;
  /// An entry met on the way through the object: looking it up again takes a time that grows with their number.
  JsonView Entry(const std::string& key, const Json& value) const;
  bool Has(const char* key) const { return value_->is_object() && value_->contains(key); }
  size_t ArraySize() const;
  double Number() const;  ///< finite
  int Int() const;
  std::string Text() const;
  /// A list of finite numbers of any length.
  std::vector<double> Numbers() const;
  const Json& value() const { return *value_; }
  const std::string& where() const { return where_; }
  [[noreturn]] void Fail(const std::string& what) const { throw FormatError(*path_, where_, what); }

 private:
  const std::string* path_;
  const Json* value_;
  std::string where_;
};

/// A text that can be a camera's name (core/label.h).
std::string CameraName(const JsonView& json);

/// Shortest text that reads back as the same double.
std::string NumberText(double value);

/// The same in the form of a C++ stream: six significant digits where they do, more where they must.
std::string StreamNumberText(double value);

/// Foreign text for a message: in quotes, on one line, at most 60 bytes of it.
std::string Quoted(const std::string& text);

}  // namespace mvstudio::dataset::internal
