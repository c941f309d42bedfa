#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/error.h"

/// Checked access to JSON files; included by .cc files of this module only.
namespace mvstudio::dataset::internal {

using Json = nlohmann::ordered_json;

/// Parses a file; nesting deeper than 64 is refused. Throws IoError, FormatError (with the byte where the text breaks).
Json ParseJsonFile(const std::string& path);

/// A value and where it stands, for messages such as `calibration.json: cameras[3].K[1][2]: must be a number`.
class JsonView {
 public:
  JsonView(const std::string& path, const Json& value, std::string where = "")
      : path_(&path), value_(&value), where_(std::move(where)) {}

  JsonView operator[](const char* key) const;
  JsonView operator[](size_t idx) const;
  bool Has(const char* key) const { return value_->is_object() && value_->contains(key); }
  size_t ArraySize() const;
  double Number() const;  ///< finite
  int Int() const;
  std::string Text() const;
  const Json& value() const { return *value_; }
  const std::string& where() const { return where_; }
  [[noreturn]] void Fail(const std::string& what) const { throw FormatError(*path_, where_, what); }

 private:
  const std::string* path_;
  const Json* value_;
  std::string where_;
};

/// Shortest text that reads back as the same double.
std::string NumberText(double value);

}  // namespace mvstudio::dataset::internal
