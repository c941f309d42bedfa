#include <charconv>
#include <cmath>
#include <sstream>
#include <system_error>

#include "calib/formats/format_text.h"
#include "calib/formats/opencv_yaml.h"
#include "calib/formats/xml.h"
#include "core/error.h"

namespace mvstudio::calib::internal {
namespace {

/// One word as its YAML would have it: a number, or text with or without quotes.
Value ScalarOf(const std::string& word) {
  Value value;
  value.text = word;
  const auto [end, code] = std::from_chars(word.data(), word.data() + word.size(), value.number);
  const bool is_number = code == std::errc() && end == word.data() + word.size() && std::isfinite(value.number);
  value.kind = is_number ? Value::Kind::kNumber : Value::Kind::kText;
  const bool quoted = word.size() > 1 && word.front() == '"' && word.back() == '"';
  if (quoted) value.text = word.substr(1, word.size() - 2);
  return value;
}

/// Text of an element: nothing, one scalar, or a list of numbers with blanks between them.
Value TextValue(const std::string& text, bool is_list) {
  std::istringstream in(text);
  Value list;
  list.kind = Value::Kind::kList;
  for (std::string word; in >> word;) list.items.push_back(ScalarOf(word));
  if (is_list) return list;
  if (list.items.empty()) return {};
  if (list.items.size() == 1) return list.items[0];
  for (const Value& item : list.items) {
    if (item.kind == Value::Kind::kNumber) continue;
    Value words;  // a sentence
    words.kind = Value::Kind::kText, words.text = text;
    return words;
  }
  return list;
}

/// An element: its children by name, or, where OpenCV calls each of them `_`, one after the other. ParseXml limits the depth.
Value ElementValue(const std::string& path, const pugi::xml_node& node) {
  if (!node.first_child() || node.first_child().type() != pugi::node_element)
    return TextValue(node.child_value(), std::string_view(node.name()) == "data");
  Value value;
  value.kind = std::string_view(node.first_child().name()) == "_" ? Value::Kind::kList : Value::Kind::kTable;
  for (const pugi::xml_node& child : node.children()) {
    if (child.type() != pugi::node_element) continue;
    Value item = ElementValue(path, child);
    if (value.kind == Value::Kind::kList) {
      value.items.push_back(std::move(item));
    } else if (!AddEntry(child.name(), std::move(item), &value)) {
      throw FormatError(path, Printable(child.name()), "occurs twice");
    }
  }
  return value;
}

}  // namespace

Value ParseOpenCvXml(const std::string& path, const std::string& text) {
  pugi::xml_document document;
  ParseXml(path, text, &document);
  const pugi::xml_node root = document.document_element();
  if (std::string_view(root.name()) != "opencv_storage")
    throw FormatError(path, Printable(root.name()), "OpenCV's XML files hold one <opencv_storage>");
  Value value = ElementValue(path, root);
  if (value.kind != Value::Kind::kTable) throw FormatError(path, "opencv_storage", "holds no entries; is the file truncated?");
  return value;
}

}  // namespace mvstudio::calib::internal
