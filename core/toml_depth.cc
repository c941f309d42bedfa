#include "core/toml_depth.h"

#include <algorithm>
#include <cstddef>

#include "core/error.h"

namespace mvstudio {
namespace {

/// Position behind the string that begins at `at`; a string without an end reaches to the end of the line, or of the text when
/// it may have several lines.
size_t SkipString(std::string_view text, size_t at) {
  const char quote = text[at];
  const bool long_form = text.size() - at >= 3 && text[at + 1] == quote && text[at + 2] == quote;
  const size_t width = long_form ? 3 : 1;
  for (at += width; at < text.size(); ++at) {
    if (text[at] == '\\' && quote == '"') {
      ++at;
    } else if (text[at] == '\n' && !long_form) {
      return at;
    } else if (text.compare(at, width, std::string_view("\"\"\"'''").substr(quote == '"' ? 0 : 3, width)) == 0) {
      return at + width;
    }
  }
  return text.size();
}

/// The first place from `at` on that is in no string and no comment, or the text's end.
size_t NextCode(std::string_view text, size_t at) {
  while (at < text.size()) {
    if (text[at] == '"' || text[at] == '\'') {
      at = SkipString(text, at);
    } else if (text[at] == '#') {
      at = std::min(text.find('\n', at), text.size());
    } else {
      break;
    }
  }
  return std::min(at, text.size());
}

}  // namespace

size_t TomlKeyParts(std::string_view text) {
  size_t longest = 0, parts = 1;
  for (size_t at = NextCode(text, 0); at < text.size(); at = NextCode(text, at + 1)) {
    const char c = text[at];
    if (c == '.') longest = std::max(longest, ++parts);
    if (std::string_view("=,\n{}[]").find(c) != std::string_view::npos) parts = 1;
  }
  return std::max<size_t>(longest, text.empty() ? 0 : 1);
}

size_t TomlBraceInList(std::string_view text) {
  std::string open;  // brackets and braces that are not closed yet
  for (size_t at = NextCode(text, 0); at < text.size(); at = NextCode(text, at + 1)) {
    const char c = text[at];
    if (c == '[' || c == '{') open += c;
    if (c != ']' && c != '}') continue;
    if (c == '}' && !open.empty() && open.back() == '[') {
      return 1 + static_cast<size_t>(std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(at), '\n'));
    }
    if (!open.empty()) open.pop_back();
  }
  return 0;
}

void RequireParsableToml(std::string_view text, const std::string& path) {
  if (TomlKeyParts(text) > kMaxTomlKeyParts) {
    throw FormatError(path, "", "a key has more than " + std::to_string(kMaxTomlKeyParts) + " parts");
  }
  const size_t line = TomlBraceInList(text);
  if (line > 0) throw FormatError(path, "line " + std::to_string(line), "a `}` where a list goes on; is its `]` missing?");
}

}  // namespace mvstudio
