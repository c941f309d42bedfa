// Private: pybind11's types.
#pragma once

#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <set>
#include <string>
#include <type_traits>
#include <vector>

#include "core/choice/option_style.h"
#include "core/error.h"
#include "core/fields.h"

/// Options structs (core/fields.h) from Python's arguments.
namespace mvstudio::python {

namespace py = pybind11;

/// "max-error-px" -> "max_error_px"; of several names with commas the first; words of Python's own end in "_".
std::string ArgumentName(const std::string& field);

/// A path or a number where a text is expected.
std::string TextOf(const py::handle& value);
/// One text, a list of them, or of a dict "KEY=VALUE" each.
std::vector<std::string> TextsOf(const py::handle& value);

template <class T>
inline constexpr bool kHasAnyWords = kHasWords<T> || kHasSharedWords<T>;

template <class T>
struct IsList : std::false_type {};
template <class T>
struct IsList<std::vector<T>> : std::true_type {
  using Item = T;
};

/// A field's value as Python has it: choices are their words.
template <class Value>
py::object ValueOf(const Value& value) {
  if constexpr (kHasAnyWords<Value>) {
    return py::str(std::string(ToString(value)));
  } else if constexpr (IsList<Value>::value) {
    py::list items;
    for (const auto& item : value) items.append(ValueOf(item));
    return items;
  } else {
    return py::cast(value);
  }
}

template <class Value>
void SetValue(const py::handle& given, const std::string& name, Value* value) {
  if constexpr (kHasAnyWords<Value>) {
    std::string text;
    for (const std::string& word : TextsOf(given)) text += (text.empty() ? "" : ",") + word;
    SetFromString(text, name, value);
  } else if constexpr (std::is_same_v<Value, std::string>) {
    *value = TextOf(given);
  } else if constexpr (std::is_same_v<Value, std::vector<std::string>>) {
    *value = TextsOf(given);
  } else if constexpr (IsList<Value>::value) {
    using Item = typename IsList<Value>::Item;
    value->clear();
    if constexpr (kHasAnyWords<Item>) {
      for (const std::string& text : TextsOf(given)) SetFromString(text, name, &value->emplace_back());
    } else {
      for (const py::handle& item : given) value->push_back(item.cast<Item>());
    }
  } else {
    *value = given.cast<Value>();
  }
}

/// Every stage has this argument beside its options (MayReplace); an option of that name is none.
inline constexpr char kOverwrite[] = "overwrite";

/// Lists the fields: dicts of name, flag, default, type, help and subject.
class FieldLister {
 public:
  explicit FieldLister(py::list* fields) : fields_(fields) {}

  template <class Value>
  void operator()(const std::string& name, Value& value, const std::string& help) {
    if (name == kOverwrite) return;
    py::dict field;
    field["name"] = ArgumentName(name), field["flag"] = name, field["default"] = ValueOf(value);
    field["help"] = help, field["subject"] = subject_;
    field["type"] = kHasAnyWords<Value>               ? "word"
                    : IsList<Value>::value            ? "list"
                    : std::is_same_v<Value, bool>     ? "bool"
                    : std::is_integral_v<Value>       ? "int"
                    : std::is_floating_point_v<Value> ? "float"
                                                      : "text";
    fields_->append(field);
  }
  template <class Value>
  void Styled(OptionStyle style, const std::string& name, Value& value, const std::string& help) {
    (*this)(name, value, help);
    if (name == kOverwrite) return;
    if (style == OptionStyle::kFolder || style == OptionStyle::kFile || style == OptionStyle::kPlace)
      (*fields_)[fields_->size() - 1]["type"] = "path";
  }
  void StartGroup(const char* subject) { subject_ = subject; }

 private:
  py::list* fields_;
  std::string subject_ = "Options";
};

/// Sets the fields that a dict names; afterwards given() are their names as an option's, and `left` those that no field has.
class FieldSetter {
 public:
  explicit FieldSetter(const py::dict& arguments) : left_(py::dict(**arguments)) {}

  template <class Value>
  void operator()(const std::string& names, Value& value, const std::string&) {
    const py::str argument(ArgumentName(names));
    if (!left_.contains(argument)) return;
    const py::object given = left_[argument];
    left_.attr("pop")(argument);
    const std::string name = names.substr(0, names.find(','));
    given_.insert(name);
    try {
      SetValue(given, name, &value);
    } catch (const py::cast_error&) {
      throw UsageError("option '" + name + "': " + std::string(py::repr(given)) + " is no such value");
    }
  }
  template <class Value>
  void Styled(OptionStyle, const std::string& names, Value& value, const std::string& help) {
    (*this)(names, value, help);
  }

  const std::set<std::string>& given() const { return given_; }
  const py::dict& left() const { return left_; }

 private:
  py::dict left_;
  std::set<std::string> given_;
};

}  // namespace mvstudio::python
