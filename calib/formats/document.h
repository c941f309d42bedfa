// Private: for the readers of calib/.
#pragma once

#include <Eigen/Core>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "calib/formats/format_text.h"
#include "geometry/rigid/rigid3.h"

/// A value of a JSON, Python-literal or YAML text, and checked access to it.
namespace mvstudio::calib::internal {

struct Value {
  enum class Kind { kNull, kNumber, kText, kList, kTable };
  Kind kind = Kind::kNull;
  int line = 0;  ///< of YAML: line of the value or its key
  double number = 0;
  std::string text;  ///< of YAML: also numbers, as written
  std::vector<Value> items;
  std::vector<std::pair<std::string, Value>> entries;
  mutable bool used = false;  ///< of an entry: a ValueView was asked for its key
};

/// Parses one value in the syntax of JSON or of Python literals (dict, list, tuple, numbers, strings, None, True, False,
/// comments). Finite numbers only; at most 16 levels deep and kMaxKeys keys per table; keys must be unique. Throws
/// FormatError with the line.
Value ParseLiteral(const std::string& path, const std::string& text);

/// Parses YAML with yaml-cpp: block and flow style, quoted and plain scalars; the keys of several documents are merged.
/// Limits as above, and at most 16 MiB; true and false are 1 and 0; tags are ignored. Rejected: anchors and aliases, keys
/// that are not text, control characters. Throws FormatError with the line.
Value ParseYaml(const std::string& path, const std::string& text);

/// Maximum number of keys of a table: the time of a look-up grows with it.
inline constexpr size_t kMaxKeys = 4096;

/// False when the key is in the table already.
bool AddEntry(const std::string& key, Value value, Value* table);

/// A value and its place, for messages such as `transforms.json: frames[3].fl_x: a number was expected`.
class ValueView {
 public:
  ValueView(const std::string& path, const Value& value, std::string where = "")
      : path_(&path), value_(&value), where_(std::move(where)) {}

  bool Has(std::string_view key) const { return Find(key) != nullptr; }
  ValueView operator[](std::string_view key) const;  ///< fails when the key is missing
  ValueView operator[](size_t idx) const;
  size_t ListSize() const;
  double Number() const;
  double Number(std::string_view key, double fallback) const { return Has(key) ? (*this)[key].Number() : fallback; }
  const std::string& Text() const;
  Eigen::VectorXd Vector() const;                          ///< a list of numbers
  Eigen::VectorXd Vector(size_t size) const;               ///< of exactly `size`
  Eigen::MatrixXd Matrix(size_t rows, size_t cols) const;  ///< a list of rows
  /// Rotation and translation of a 3x4 or 4x4 matrix [R t; 0 1].
  geometry::Rigid3 Transform() const;
  const Value& value() const { return *value_; }
  const std::string& where() const { return where_; }
  Place place() const { return {*path_, where_}; }
  [[noreturn]] void Fail(const std::string& what) const;

 private:
  const Value* Find(std::string_view key) const;

  const std::string* path_;
  const Value* value_;
  std::string where_;
};

}  // namespace mvstudio::calib::internal
