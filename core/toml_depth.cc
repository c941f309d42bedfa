#include "core/toml_depth.h"

#include <algorithm>

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

}  // namespace

size_t TomlKeyParts(std::string_view text) {
  size_t longest = 0, parts = 1;
  for (size_t at = 0; at < text.size();) {
    const char c = text[at];
    if (c == '"' || c == '\'') {
      at = SkipString(text, at);
      continue;
    }
    if (c == '#') {
      at = std::min(text.find('\n', at), text.size());
      continue;
    }
    if (c == '.') longest = std::max(longest, ++parts);
    if (std::string_view("=,\n{}[]").find(c) != std::string_view::npos) parts = 1;
    ++at;
  }
  return std::max<size_t>(longest, text.empty() ? 0 : 1);
}

}  // namespace mvstudio
