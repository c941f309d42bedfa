#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/exceptions.h>
#include <yaml-cpp/parser.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <sstream>

#include "calib/formats/document.h"
#include "core/error.h"

/// Parsed by yaml-cpp; what it says becomes our values at once, so that its own tree, aliases and recursion play no part.
namespace mvstudio::calib::internal {
namespace {

constexpr size_t kMostLevels = 16, kMostOpenBrackets = 64, kMostYamlBytes = size_t{16} << 20;

[[noreturn]] void FailAt(const std::string& path, long line, const std::string& what) {
  throw FormatError(path, "line " + std::to_string(line), what);
}

/// The parser ends a file quietly at byte 4, and remembers every bracket that is open: these are looked at first.
void CheckYamlBytes(const std::string& path, const std::string& text) {
  if (text.size() > kMostYamlBytes) {
    throw FormatError(path, "", "has more than " + std::to_string(kMostYamlBytes >> 20) + " MiB; is it a calibration?");
  }
  long line = 1;
  size_t open = 0;
  for (const char c : text) {
    line += c == '\n';
    if (c == '[' || c == '{') ++open;
    if ((c == ']' || c == '}') && open > 0) --open;
    if (open > kMostOpenBrackets) FailAt(path, line, "brackets are nested too deep, or not closed");
    const auto code = static_cast<unsigned char>(c);
    if ((code < ' ' && c != '\n' && c != '\r' && c != '\t') || code == 0x7f) FailAt(path, line, "a control character");
  }
}

Value TextValue(const std::string& text) {
  Value value;
  value.kind = Value::Kind::kText;
  value.text = text;
  return value;
}

/// A plain scalar: numbers that are finite, true and false as numbers, everything else a text.
Value PlainScalar(const std::string& text) {
  Value value = TextValue(text);
  const bool truth = text == "true" || text == "True";
  if (truth || text == "false" || text == "False") {
    value.kind = Value::Kind::kNumber, value.number = truth;
    return value;
  }
  const char *begin = text.data() + (text.size() > 1 && text[0] == '+'), *end = text.data() + text.size();
  const auto [stop, code] = std::from_chars(begin, end, value.number);
  if (code == std::errc() && stop == end && std::isfinite(value.number)) value.kind = Value::Kind::kNumber;
  return value;
}

/// Makes one value of the parser's events; several documents in a file count as one.
class YamlBuilder final : public YAML::EventHandler {
 public:
  explicit YamlBuilder(const std::string& path) : path_(path) {}

  Value TakeRoot() { return std::move(root_); }
  const std::string& last_key() const { return last_key_; }
  const YAML::Mark& last_scalar() const { return last_scalar_; }

  void OnDocumentStart(const YAML::Mark& mark) override {
    if (mark.pos == document_at_) Fail(mark, "'key: value' was expected");  // the parser would stay here for ever
    document_at_ = mark.pos;
  }
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark& mark, YAML::anchor_t) override {
    // The parser gives a last word without ':' a value at its own place.
    if (!levels_.empty() && levels_.back().has_key && mark.pos <= levels_.back().key_mark.pos) {
      Fail(levels_.back().key_mark, "'key: value' was expected, or a bracket is not closed; is the file truncated?");
    }
    Add(mark, {});
  }
  void OnAlias(const YAML::Mark& mark, YAML::anchor_t) override {
    Fail(mark, "this part of YAML is not read: an alias; write out what it stands for");
  }
  void OnAnchor(const YAML::Mark& mark, const std::string& name) override {
    Fail(mark, "this part of YAML is not read: the anchor '&" + Printable(name) + "'");
  }
  void OnScalar(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t, const std::string& text) override {
    last_scalar_ = mark;
    if (AwaitsKey()) return SetKey(mark, text);
    Add(mark, tag == "!" ? TextValue(text) : PlainScalar(text));  // "!": in quotes
  }
  void OnSequenceStart(const YAML::Mark& mark, const std::string&, YAML::anchor_t, YAML::EmitterStyle::value) override {
    Open(mark, Value::Kind::kList);
  }
  void OnMapStart(const YAML::Mark& mark, const std::string&, YAML::anchor_t, YAML::EmitterStyle::value) override {
    Open(mark, Value::Kind::kTable);
  }
  void OnSequenceEnd() override { Close(); }
  void OnMapEnd() override { Close(); }

 private:
  struct Level {
    Value value;
    std::string key;
    YAML::Mark key_mark;
    bool has_key = false;
  };

  [[noreturn]] void Fail(const YAML::Mark& mark, const std::string& what) const { FailAt(path_, mark.line + 1, what); }

  bool AwaitsKey() const {
    return !levels_.empty() && levels_.back().value.kind == Value::Kind::kTable && !levels_.back().has_key;
  }

  void SetKey(const YAML::Mark& mark, const std::string& text) {
    Level& level = levels_.back();
    if (level.value.entries.size() >= kMaxKeys) Fail(mark, "more than " + std::to_string(kMaxKeys) + " keys in one table");
    level.key = text, level.key_mark = mark, level.has_key = true;
    if (levels_.size() == 1) last_key_ = text;
  }

  void Open(const YAML::Mark& mark, Value::Kind kind) {
    if (levels_.size() >= kMostLevels) Fail(mark, "nested deeper than " + std::to_string(kMostLevels) + " levels");
    if (AwaitsKey()) Fail(mark, "a text was expected as the key");
    levels_.emplace_back().value.kind = kind;
    levels_.back().value.line = mark.line + 1;
  }

  void Close() {
    Value value = std::move(levels_.back().value);
    levels_.pop_back();
    YAML::Mark mark;
    mark.line = value.line - 1;
    Add(mark, std::move(value));
  }

  void Add(const YAML::Mark& mark, Value value) {
    if (levels_.empty()) return AddDocument(mark, std::move(value));
    Level& level = levels_.back();
    value.line = mark.line + 1;
    if (level.value.kind == Value::Kind::kList) {
      level.value.items.push_back(std::move(value));
      return;
    }
    if (!level.has_key) Fail(mark, "a key was expected before ':'");
    level.has_key = false;
    AddTo(&level.value, level.key, level.key_mark.line + 1, std::move(value));
  }

  void AddTo(Value* table, const std::string& key, int line, Value value) const {
    value.line = line;
    if (!AddEntry(key, std::move(value), table)) FailAt(path_, line, "the key '" + Printable(key) + "' occurs twice");
  }

  void AddDocument(const YAML::Mark& mark, Value value) {
    if (value.kind == Value::Kind::kNull) return;
    if (root_.kind == Value::Kind::kNull) {
      root_ = std::move(value);
      return;
    }
    if (root_.kind != Value::Kind::kTable || value.kind != Value::Kind::kTable) Fail(mark, "'key: value' was expected");
    for (auto& [key, entry] : value.entries) AddTo(&root_, key, entry.line, std::move(entry));
  }

  const std::string& path_;
  std::vector<Level> levels_;
  Value root_;
  std::string last_key_;  ///< of the outermost table
  YAML::Mark last_scalar_;
  int document_at_ = -1;
};

[[noreturn]] void FailToParse(const std::string& path, const YAML::Exception& error, const std::string& last_key) {
  const std::string where = error.mark.is_null() ? "" : "line " + std::to_string(error.mark.line + 1);
  const std::string near = last_key.empty() ? "" : " in or behind '" + Printable(last_key) + "'";
  throw FormatError(path, where,
                    "not valid YAML (" + Printable(error.msg) + ")" + near +
                        "; is a bracket or quote not closed, a line indented otherwise, or the file truncated?");
}

/// The parser takes a quote that is not closed for one that ends with the file.
void CheckLastQuote(const std::string& path, const std::string& text, const YAML::Mark& mark) {
  auto at = static_cast<size_t>(mark.pos);
  while (at < text.size() && text[at] == '!') {  // a tag
    at = text.find_first_not_of(" \t\r\n", std::min(text.find_first_of(" \t\r\n", at), text.size()));
  }
  if (at >= text.size() || (text[at] != '"' && text[at] != '\'')) return;
  if (text.find(text[at], at + 1) == std::string::npos) {
    FailAt(path, mark.line + 1, "a quoted text does not end; is the file truncated?");
  }
}

}  // namespace

Value ParseYaml(const std::string& path, const std::string& whole) {
  CheckYamlBytes(path, whole);
  const std::string text = whole.compare(0, 3, "\xef\xbb\xbf") == 0 ? whole.substr(3) : whole;
  YamlBuilder builder(path);
  try {
    std::istringstream in(text);
    YAML::Parser parser(in);
    while (parser.HandleNextDocument(builder)) continue;
  } catch (const YAML::Exception& error) {
    FailToParse(path, error, builder.last_key());
  }
  CheckLastQuote(path, text, builder.last_scalar());
  Value root = builder.TakeRoot();
  if (root.kind == Value::Kind::kNull) throw FormatError(path, "", "the file is empty");
  return root;
}

}  // namespace mvstudio::calib::internal
