#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/error.h"

/// Checked access to the JSON of this module's files; included by .cc files of this module only.
namespace mvstudio::detect::internal {

using Json = nlohmann::json;

/// Nesting deeper than 64 is refused. Throws FormatError with the byte where the text breaks.
Json ParseJson(const std::string& path, const std::string& text);

/// A value and where it stands, for messages.
class JsonView {
 public:
  JsonView(const std::string& path, const Json& value, std::string where = "")
      : path_(&path), value_(&value), where_(std::move(where)) {}

  JsonView operator[](const char* key) const;
  JsonView operator[](size_t idx) const;
  bool Has(const char* key) const { return value_->is_object() && value_->contains(key); }
  size_t ArraySize() const;
  /// A whole number; TensorFlow writes 64-bit numbers as text.
  int64_t Int() const;
  double Number() const;  ///< finite
  std::string Text() const;
  bool Flag() const;
  const Json& value() const { return *value_; }
  const std::string& path() const { return *path_; }
  const std::string& where() const { return where_; }
  /// The same value under a name that helps more than its place.
  JsonView Named(const std::string& where) const { return JsonView(*path_, *value_, where); }
  [[noreturn]] void Fail(const std::string& what) const { throw FormatError(*path_, where_, what); }

 private:
  const std::string* path_;
  const Json* value_;
  std::string where_;
};

/// Bytes of base64 text (RFC 4648, with padding). Throws FormatError.
std::string DecodeBase64(const std::string& path, const std::string& where, const std::string& text);

}  // namespace mvstudio::detect::internal
