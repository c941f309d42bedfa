#include "core/text/one_line.h"

#include <algorithm>

#include "core/utf8.h"

namespace mvstudio {
namespace {

/// C1 controls, line separators, and the marks that turn the direction of writing.
bool IsHiddenControl(const std::string& character) {
  const auto between = [&](const char* first, const char* last) { return first <= character && character <= last; };
  return between("\u0080", "\u009f") || between("\u200e", "\u200f") || between("\u2028", "\u202e") ||
         between("\u2066", "\u2069");
}

/// What would move the cursor, colour the terminal or turn the direction of writing becomes '?', and so do bytes that are no
/// UTF-8.
std::string Harmless(const std::string& text, bool keep_lines) {
  std::string line;
  for (size_t at = 0; at < text.size();) {
    const size_t length = Utf8Length(text, at);
    const auto lead = static_cast<unsigned char>(text[at]);
    if (lead == '\n' || lead == '\t') {
      line += lead == '\n' && keep_lines ? '\n' : ' ';
    } else if (length == 0 || lead < 0x20 || lead == 0x7f || IsHiddenControl(text.substr(at, length))) {
      line += '?';
    } else {
      line.append(text, at, length);
    }
    at += std::max<size_t>(length, 1);
  }
  return line;
}

}  // namespace

std::string OneLine(const std::string& text) {
  constexpr size_t kMaxBytes = 4000;
  std::string line = Harmless(text, false);
  while (!line.empty() && line.back() == ' ') line.pop_back();
  if (line.size() <= kMaxBytes) return line;
  size_t head = kMaxBytes / 2, tail = line.size() - kMaxBytes / 2;
  while (static_cast<unsigned char>(line[head]) >> 6 == 2) --head;
  while (tail < line.size() && static_cast<unsigned char>(line[tail]) >> 6 == 2) ++tail;
  return line.substr(0, head) + " [...] " + line.substr(tail);
}

std::string ManyLines(const std::string& text) { return Harmless(text, true); }

}  // namespace mvstudio
