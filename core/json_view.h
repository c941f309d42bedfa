#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "core/error.h"

namespace mvstudio {

/// Checked access to a value of the library nlohmann::json with its place, for messages such as `calibration.json:
/// cameras[3].K[1][2]: must be a number`. As in core/json_tree.h the library's type is a template parameter. `path` and
/// `value` must outlive the view.
template <class Json>
class BasicJsonView {
 public:
  BasicJsonView(const std::string& path, const Json& value, std::string where = "")
      : path_(&path), value_(&value), where_(std::move(where)) {}

  BasicJsonView operator[](const char* key) const {
    if (!value_->is_object()) Fail("must be an object");
    const auto found = value_->find(key);
    const std::string where = Inside(key);
    if (found == value_->end()) throw FormatError(*path_, where, "is missing");
    return BasicJsonView(*path_, *found, where);
  }
  BasicJsonView operator[](size_t idx) const {
    const std::string where = where_ + "[" + std::to_string(idx) + "]";
    if (idx >= ArraySize()) throw FormatError(*path_, where, "is missing");
    return BasicJsonView(*path_, (*value_)[idx], where);
  }
  /// An entry from an iteration over the object: looking it up again takes time that grows with their number.
  BasicJsonView Entry(const std::string& key, const Json& value) const { return BasicJsonView(*path_, value, Inside(key)); }
  /// The same value under a more helpful name than its place.
  BasicJsonView Named(const std::string& where) const { return BasicJsonView(*path_, *value_, where); }

  bool Has(const char* key) const { return value_->is_object() && value_->contains(key); }
  size_t ArraySize() const {
    if (!value_->is_array()) Fail("must be a list");
    return value_->size();
  }

  /// Finite.
  double Number() const {
    if (!value_->is_number()) Fail("must be a number");
    const double number = value_->template get<double>();
    if (!std::isfinite(number)) Fail("must be finite");
    return number;
  }
  /// A list of finite numbers of any length.
  std::vector<double> Numbers() const {
    std::vector<double> numbers(ArraySize());
    for (size_t i = 0; i < numbers.size(); ++i) {
      const Json& value = (*value_)[i];
      if (!value.is_number()) (*this)[i].Fail("must be a number");
      numbers[i] = value.template get<double>();
    }
    return numbers;
  }
  int Int() const { return static_cast<int>(Whole(std::numeric_limits<int>::max())); }
  /// A whole number of at most 15 digits; TensorFlow writes 64-bit numbers as text.
  int64_t LongInt() const {
    if (!value_->is_string()) return static_cast<int64_t>(Whole(1e15));
    const std::string text = Text();
    const bool negative = text.size() > 1 && text[0] == '-';
    const std::string digits = text.substr(negative);
    if (digits.empty() || digits.size() > 15 || digits.find_first_not_of("0123456789") != std::string::npos) {
      Fail("must be a whole number");
    }
    return (negative ? -1 : 1) * std::stoll(digits);
  }
  std::string Text() const {
    if (!value_->is_string()) Fail("must be a text");
    return value_->template get<std::string>();
  }
  bool Flag() const {
    if (!value_->is_boolean()) Fail("must be true or false");
    return value_->template get<bool>();
  }

  const Json& value() const { return *value_; }
  const std::string& path() const { return *path_; }
  const std::string& where() const { return where_; }
  [[noreturn]] void Fail(const std::string& what) const { throw FormatError(*path_, where_, what); }

 private:
  std::string Inside(const std::string& key) const { return where_.empty() ? key : where_ + "." + key; }

  double Whole(double most) const {
    const double number = Number();
    if (number != std::floor(number) || std::abs(number) > most) Fail("must be a whole number");
    return number;
  }

  const std::string* path_;
  const Json* value_;
  std::string where_;
};

}  // namespace mvstudio
