#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/error.h"
#include "core/json_tree.h"

namespace mvstudio {

/// Text from outside for a message: on one line, at most 60 bytes of it.
template <class Json>
std::string JsonEscaped(const std::string& text) {
  constexpr size_t kMaxBytes = 60;
  const std::string shown = Json(text.substr(0, kMaxBytes)).dump(-1, ' ', true, Json::error_handler_t::replace);
  return shown.substr(1, shown.size() - 2) + (text.size() > kMaxBytes ? "…" : "");
}

/// The same in quotes.
template <class Json>
std::string JsonQuoted(const std::string& text) {
  return "'" + JsonEscaped<Json>(text) + "'";
}

/// Throws FormatError with the place of the problem, that of the key or the byte, unless there is none.
template <class Json>
void ThrowIfBroken(const JsonProblem& problem, const JsonLimits& limits, const std::string& path) {
  const std::string place = "byte " + std::to_string(problem.byte);
  switch (problem.kind) {
    case JsonProblem::Kind::kNone:
      return;
    case JsonProblem::Kind::kDepth:
      throw FormatError(path, "", "is nested deeper than " + std::to_string(limits.max_depth) + " levels");
    case JsonProblem::Kind::kTwice:
      throw FormatError(path, problem.where, "the key " + JsonQuoted<Json>(problem.key) + " is there twice");
    case JsonProblem::Kind::kNumber:
      throw FormatError(path, place, "the number is beyond the range of doubles");
    case JsonProblem::Kind::kNotFinite:
      throw FormatError(path, problem.where.empty() ? place : problem.where,
                        "is " + problem.key + ", which is no number: every number is needed here");
    case JsonProblem::Kind::kSyntax:
      throw FormatError(path, place, "is not valid JSON; cut short or damaged?");
  }
}

/// The tree of a text. Throws FormatError.
template <class Json>
Json JsonFromText(std::string_view text, const JsonLimits& limits, const std::string& path) {
  Json json;
  ThrowIfBroken<Json>(ParseJsonTree(text, limits, &json), limits, path);
  return json;
}

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
  /// The value at a JSON pointer ("/crop/fill"), which names its place.
  BasicJsonView AtPointer(const std::string& pointer) const {
    const typename Json::json_pointer at(pointer);
    if (!value_->contains(at)) throw FormatError(*path_, pointer, "is missing");
    return BasicJsonView(*path_, value_->at(at), pointer);
  }
  bool HasPointer(const std::string& pointer) const { return value_->contains(typename Json::json_pointer(pointer)); }
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
  /// The same, written as one: 3, not 3.0.
  int PlainInt() const {
    if (!value_->is_number_integer()) Fail("must be a whole number");
    return Int();
  }
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
