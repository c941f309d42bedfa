#pragma once

#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace mvstudio::report {

/// A JSON tree that is read leniently: missing values and those of another kind read as null, NaN or the empty string and
/// never throw. Fields keep the order of the file; whole numbers keep all 64 bits.
class Value {
 public:
  enum class Kind { kNull, kBool, kInteger, kNumber, kText, kArray, kObject };
  using Items = std::vector<Value>;
  using Fields = std::vector<std::pair<std::string, Value>>;

  Value() = default;
  Value(bool flag) : kind_(Kind::kBool), integer_(flag) {}
  Value(int number) : kind_(Kind::kInteger), integer_(number) {}
  Value(int64_t number) : kind_(Kind::kInteger), integer_(number) {}
  Value(double number) : kind_(Kind::kNumber), number_(number) {}
  Value(const char* text) : kind_(Kind::kText), text_(text) {}
  Value(std::string text) : kind_(Kind::kText), text_(std::move(text)) {}
  static Value Array() { return OfKind(Kind::kArray); }
  static Value Object() { return OfKind(Kind::kObject); }

  /// Throws FormatError(path, …) for text that is not JSON or is nested deeper than 64 levels.
  static Value Parse(const std::string& json_text, const std::string& path_for_messages);
  /// JSON text; numbers that are not finite become null, bytes that are not UTF-8 become U+FFFD. `indent` < 0: one line.
  std::string Dump(int indent = -1) const;

  Kind kind() const { return kind_; }
  bool IsNull() const { return kind_ == Kind::kNull; }
  bool IsObject() const { return kind_ == Kind::kObject; }
  bool IsArray() const { return kind_ == Kind::kArray; }
  bool IsText() const { return kind_ == Kind::kText; }
  bool IsNumber() const { return kind_ == Kind::kInteger || kind_ == Kind::kNumber; }

  /// Field `key`, or null.
  const Value& operator[](const std::string& key) const;
  const Value& operator[](const char* key) const { return (*this)[std::string(key)]; }
  /// The value at a dotted path of fields ("holdout.fd.value"), or null.
  const Value& Path(const std::string& dotted) const;
  /// Item `index` of an array, or null.
  const Value& At(size_t index) const;
  const Items& items() const { return items_; }
  const Fields& fields() const { return fields_; }

  double Number(double fallback = std::numeric_limits<double>::quiet_NaN()) const;
  bool Flag(bool fallback = false) const { return kind_ == Kind::kBool ? integer_ != 0 : fallback; }
  std::string Text(const std::string& fallback = {}) const { return kind_ == Kind::kText ? text_ : fallback; }
  int64_t integer() const { return integer_; }

  /// First of `keys` (dotted paths) that holds a finite number, or NaN.
  double FirstNumber(const std::vector<std::string>& keys) const;

  /// Both turn a null value into an object or array first and return *this.
  Value& Set(const std::string& key, Value value);
  Value& Append(Value value);

 private:
  static Value OfKind(Kind kind) {
    Value value;
    value.kind_ = kind;
    return value;
  }

  size_t IndexOf(const std::string& key) const;  ///< number of fields: none

  Kind kind_ = Kind::kNull;
  int64_t integer_ = 0;
  double number_ = 0;
  std::string text_;
  Items items_;
  Fields fields_;
  std::shared_ptr<std::map<std::string, size_t>> index_;  ///< of objects with many fields; copies share it
};

}  // namespace mvstudio::report
