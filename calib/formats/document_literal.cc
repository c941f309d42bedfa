#include <algorithm>
#include <cctype>

#include "calib/formats/document.h"
#include "core/error.h"
#include "core/utf8.h"

namespace mvstudio::calib::internal {
namespace {

constexpr int kMaxDepth = 16;

/// JSON and Python literals.
class LiteralScanner {
 public:
  LiteralScanner(const std::string& path, std::string_view text) : path_(path), text_(text) {}

  Value Whole() {
    Value value = Read(0);
    SkipSpace();
    if (position_ < text_.size()) Fail("nothing was expected after the value");
    return value;
  }

 private:
  [[noreturn]] void Fail(const std::string& what) const {
    const auto end = text_.begin() + static_cast<std::ptrdiff_t>(std::min(position_, text_.size()));
    throw FormatError(path_, "line " + std::to_string(1 + std::count(text_.begin(), end, '\n')), what);
  }
  /// Line of position_; counts on from the last call, so that a file of many numbers is not counted again for each.
  long Line() {
    const auto begin = text_.begin();
    line_ += std::count(begin + static_cast<std::ptrdiff_t>(counted_), begin + static_cast<std::ptrdiff_t>(position_), '\n');
    counted_ = position_;
    return line_;
  }
  char Peek() const { return position_ < text_.size() ? text_[position_] : '\0'; }

  void SkipSpace() {
    while (position_ < text_.size()) {
      if (text_[position_] == '#') {
        position_ = std::min(text_.find('\n', position_), text_.size());
      } else if (std::isspace(static_cast<unsigned char>(text_[position_]))) {
        ++position_;
      } else {
        break;
      }
    }
  }
  bool Accept(char c) {
    SkipSpace();
    if (Peek() != c) return false;
    ++position_;
    return true;
  }

  Value Read(int depth) {
    if (depth > kMaxDepth) Fail("nested deeper than " + std::to_string(kMaxDepth) + " levels");
    SkipSpace();
    if (position_ >= text_.size()) Fail("a value was expected; is the file truncated?");
    const char c = Peek();
    if (c == '{') return ReadTable(depth);
    if (c == '[') return ReadList(']', depth);
    if (c == '(') return ReadList(')', depth);
    if (IsStringStart()) return ReadStrings();
    return ReadWord();
  }

  Value ReadTable(int depth) {
    Value table;
    table.kind = Value::Kind::kTable;
    ++position_;
    while (!Accept('}')) {
      if (table.entries.size() >= kMaxKeys) Fail("more than " + std::to_string(kMaxKeys) + " keys in one table");
      const Value key = Read(depth + 1);
      if (key.kind != Value::Kind::kText) Fail("a quoted key was expected");
      if (!Accept(':')) Fail("':' was expected after the key '" + Printable(key.text) + "'; is the file truncated?");
      if (!AddEntry(key.text, Read(depth + 1), &table)) Fail("the key '" + Printable(key.text) + "' occurs twice");
      if (!Accept(',')) {
        if (!Accept('}')) Fail("',' or '}' was expected; is the file truncated?");
        break;
      }
    }
    return table;
  }

  Value ReadList(char close, int depth) {
    Value list;
    list.kind = Value::Kind::kList;
    ++position_;
    while (!Accept(close)) {
      list.items.push_back(Read(depth + 1));
      if (!Accept(',')) {
        if (!Accept(close)) Fail(std::string("',' or '") + close + "' was expected; is the file truncated?");
        break;
      }
    }
    return list;
  }

  bool IsStringStart() const {
    size_t at = position_;
    while (at < text_.size() && at < position_ + 2 && std::string_view("bBrRuU").find(text_[at]) != std::string_view::npos)
      ++at;
    return at < text_.size() && (text_[at] == '\'' || text_[at] == '"');
  }

  /// Python joins strings that follow each other.
  Value ReadStrings() {
    Value value;
    value.kind = Value::Kind::kText;
    do {
      bool raw = false;
      while (Peek() != '\'' && Peek() != '"') raw |= text_[position_] == 'r' || text_[position_] == 'R', ++position_;
      AppendString(raw, &value.text);
      SkipSpace();
    } while (IsStringStart());
    if (!IsUtf8(value.text)) Fail("the text '" + Printable(value.text) + "' is not UTF-8");
    return value;
  }

  void AppendString(bool raw, std::string* out) {
    const char quote = text_[position_++];
    while (true) {
      if (position_ >= text_.size()) Fail("a quoted text does not end; is the file truncated?");
      const char c = text_[position_++];
      if (c == quote) return;
      if (c == '\\' && position_ < text_.size() && !raw) {
        AppendEscaped(text_[position_++], out);
      } else {
        *out += c;
      }
    }
  }

  void AppendEscaped(char c, std::string* out) {
    const size_t found = std::string_view("nrtbf").find(c);
    if (found != std::string_view::npos) {
      *out += "\n\r\t\b\f"[found];
    } else if (c == 'u' || c == 'x') {
      AppendCodePoint(c == 'u' ? 4 : 2, out);
    } else if (c != '\n') {
      *out += c;
    }
  }

  void AppendCodePoint(size_t digits, std::string* out) {
    unsigned code = 0;
    for (size_t i = 0; i < digits; ++i, ++position_) {
      if (!std::isxdigit(static_cast<unsigned char>(Peek()))) Fail("hexadecimal digits were expected after '\\'");
      const char digit = static_cast<char>(std::tolower(static_cast<unsigned char>(Peek())));
      code = code * 16 + static_cast<unsigned>(digit <= '9' ? digit - '0' : digit - 'a' + 10);
    }
    if (code < 0x80) {
      *out += static_cast<char>(code);
    } else if (code < 0x800) {
      *out += static_cast<char>(0xc0 | (code >> 6));
      *out += static_cast<char>(0x80 | (code & 0x3f));
    } else {
      *out += static_cast<char>(0xe0 | (code >> 12));
      *out += static_cast<char>(0x80 | ((code >> 6) & 0x3f));
      *out += static_cast<char>(0x80 | (code & 0x3f));
    }
  }

  Value ReadWord() {
    const size_t start = position_;
    position_ = std::min(text_.find_first_of(" \t\r\n,]})[{(#:'\"", position_), text_.size());
    const std::string_view word = text_.substr(start, position_ - start);
    if (word.empty()) Fail("a value was expected");
    Value value;
    if (word == "None" || word == "null" || word == "~") return value;
    const bool truth = word == "True" || word == "true";
    if (truth || word == "False" || word == "false") {
      value.kind = Value::Kind::kNumber;
      value.number = truth;
      return value;
    }
    position_ = start;
    value.number = ParseNumber(word, {path_, "line " + std::to_string(Line())});
    position_ = start + word.size();
    value.kind = Value::Kind::kNumber;
    return value;
  }

  const std::string& path_;
  std::string_view text_;
  long line_ = 1;
  size_t position_ = 0, counted_ = 0;
};

}  // namespace

Value ParseLiteral(const std::string& path, const std::string& text) { return LiteralScanner(path, text).Whole(); }

}  // namespace mvstudio::calib::internal
