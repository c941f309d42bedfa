#pragma once

#include <string>

namespace mvstudio {

/// The word as a shell reads it back: itself, or in single quotes where blanks or other characters would split or change it.
/// For every command and option that a message tells people to type.
inline std::string ShellWord(const std::string& word) {
  static const std::string kPlain = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-+=/.,:@%";
  if (!word.empty() && word.find_first_not_of(kPlain) == std::string::npos) return word;
  std::string out = "'";
  for (const char c : word) out += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return out + "'";
}

}  // namespace mvstudio
