#include <algorithm>
#include <cctype>

#include "calib/formats/document_internal.h"
#include "core/error.h"

namespace mvstudio::calib::internal {
namespace {

constexpr int kMaxDepth = 16;

/// A line of YAML without its indentation and comment.
struct YamlLine {
  size_t indent;
  std::string text;
  int number;
};

/// Without a trailing comment: ' #' outside quotes.
std::string WithoutComment(const std::string& line) {
  char quote = '\0';
  for (size_t i = 0; i < line.size(); ++i) {
    if (quote) {
      if (line[i] == quote) quote = '\0';
    } else if (line[i] == '\'' || line[i] == '"') {
      quote = line[i];
    } else if (line[i] == '#' && (i == 0 || std::isspace(static_cast<unsigned char>(line[i - 1])))) {
      return line.substr(0, i);
    }
  }
  return line;
}

class YamlParser {
 public:
  YamlParser(const std::string& path, const std::string& text) : path_(path) {
    int number = 0;
    for (size_t start = 0; start < text.size(); ++number) {
      const size_t end = std::min(text.find('\n', start), text.size());
      AddLine(WithoutComment(text.substr(start, end - start)), number + 1);
      start = end + 1;
    }
  }

  Value Whole() {
    if (lines_.empty()) throw FormatError(path_, "", "the file is empty");
    Value value = ReadBlock(lines_[0].indent, 0);
    if (next_ < lines_.size()) Fail("the indentation does not fit");
    return value;
  }

 private:
  [[noreturn]] void Fail(const std::string& what) const {
    throw FormatError(path_, "line " + std::to_string(lines_[std::min(next_, lines_.size() - 1)].number), what);
  }

  void AddLine(const std::string& line, int number) {
    const size_t first = line.find_first_not_of(" \t\r");
    if (first == std::string::npos || line.compare(0, 3, "---") == 0 || line.compare(0, 3, "...") == 0 || line[0] == '%')
      return;
    const size_t last = line.find_last_not_of(" \t\r");
    lines_.push_back({first, line.substr(first, last + 1 - first), number});
  }

  bool IsItem() const { return lines_[next_].text == "-" || lines_[next_].text.compare(0, 2, "- ") == 0; }

  Value ReadBlock(size_t indent, int depth) {
    if (depth > kMaxDepth) Fail("nested deeper than " + std::to_string(kMaxDepth) + " levels");
    Value value;
    value.kind = IsItem() ? Value::Kind::kList : Value::Kind::kTable;
    while (next_ < lines_.size() && lines_[next_].indent == indent && IsItem() == (value.kind == Value::Kind::kList)) {
      if (value.kind == Value::Kind::kList) {
        value.items.push_back(ReadItem(indent, depth));
      } else {
        ReadEntry(indent, depth, &value);
      }
    }
    if (next_ < lines_.size() && lines_[next_].indent > indent) Fail("the indentation does not fit");
    return value;
  }

  Value ReadItem(size_t indent, int depth) {
    YamlLine& line = lines_[next_];
    const size_t rest = line.text.find_first_not_of(' ', 1);
    if (rest == std::string::npos) {
      ++next_;
      return NestedOrNull(indent + 1, depth);
    }
    const bool is_block = line.text.compare(rest, 2, "- ") == 0 || KeyLength(line.text.substr(rest)) != std::string::npos;
    if (!is_block) return Scalar(lines_[next_++].text.substr(rest));
    line.indent += rest;
    line.text = line.text.substr(rest);
    return ReadBlock(line.indent, depth + 1);
  }

  void ReadEntry(size_t indent, int depth, Value* table) {
    if (table->entries.size() >= kMaxKeys) Fail("more than " + std::to_string(kMaxKeys) + " keys in one table");
    const YamlLine line = lines_[next_];
    const size_t length = KeyLength(line.text);
    if (length == std::string::npos) Fail("'key: value' was expected; is the file truncated?");
    std::string key = line.text.substr(0, length);
    if (key.size() >= 2 && (key[0] == '"' || key[0] == '\'') && key.back() == key[0]) key = key.substr(1, key.size() - 2);
    const size_t rest = line.text.find_first_not_of(' ', length + 1);
    if (rest != std::string::npos) {
      if (!AddEntry(key, Scalar(line.text.substr(rest)), table)) Fail("the key '" + Printable(key) + "' stands twice");
      ++next_;
      return;
    }
    ++next_;
    const bool list_below = next_ < lines_.size() && lines_[next_].indent == indent && IsItem();
    Value nested = NestedOrNull(list_below ? indent : indent + 1, depth);
    if (!AddEntry(key, std::move(nested), table)) Fail("the key '" + Printable(key) + "' stands twice");
  }

  Value NestedOrNull(size_t least_indent, int depth) {
    if (next_ >= lines_.size() || lines_[next_].indent < least_indent) return Value();
    return ReadBlock(lines_[next_].indent, depth + 1);
  }

  /// Characters before the ':' of a 'key: value' line; npos when it is none.
  static size_t KeyLength(const std::string& text) {
    if (text[0] == '[' || text[0] == '{') return std::string::npos;
    for (size_t at = text.find(':'); at != std::string::npos; at = text.find(':', at + 1)) {
      if (at > 0 && (at + 1 == text.size() || text[at + 1] == ' ')) return at;
    }
    return std::string::npos;
  }

  Value Scalar(const std::string& text) {
    const bool flow = text[0] == '[' || text[0] == '{';
    const bool quoted = text[0] == '"' || text[0] == '\'';
    const bool numeric = text.find_first_not_of("0123456789+-.eE") == std::string::npos;
    if (flow || quoted || numeric || text == "null" || text == "~" || text == "true" || text == "false") {
      return ParseFlow(path_, text, lines_[std::min(next_, lines_.size() - 1)].number);
    }
    if (text[0] == '&' || text[0] == '*' || text[0] == '!' || text[0] == '|' || text[0] == '>') {
      Fail("this part of YAML is not read: '" + Printable(text) + "'");
    }
    Value value;
    value.kind = Value::Kind::kText;
    value.text = text;
    return value;
  }

  const std::string& path_;
  std::vector<YamlLine> lines_;
  size_t next_ = 0;
};

}  // namespace

Value ParseYaml(const std::string& path, const std::string& text) { return YamlParser(path, text).Whole(); }

}  // namespace mvstudio::calib::internal
