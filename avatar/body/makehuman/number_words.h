// Private: lines of numbers, for the readers of this folder.
#pragma once

#include <algorithm>
#include <charconv>
#include <cmath>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "core/error.h"

/// Lines of numbers separated by blanks. Included by .cc files of this folder only.
namespace mvstudio::body::internal {

/// Takes one line off `text`, without its line break.
inline std::string_view TakeLine(std::string_view* text) {
  const size_t end = text->find('\n');
  std::string_view line = text->substr(0, end);
  text->remove_prefix(end == std::string_view::npos ? text->size() : end + 1);
  if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
  return line;
}

inline std::vector<std::string_view> Words(std::string_view line) {
  std::vector<std::string_view> words;
  for (size_t at = 0; (at = line.find_first_not_of(" \t", at)) != std::string_view::npos;) {
    const size_t end = std::min(line.find_first_of(" \t", at), line.size());
    words.push_back(line.substr(at, end - at));
    at = end;
  }
  return words;
}

/// A finite number; `where` names its place.
inline double NumberOf(std::string_view word, const std::string& path, const std::string& where) {
  double value = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc() || end != word.data() + word.size() || !std::isfinite(value))
    throw FormatError(path, where, "must be a finite number");
  return value;
}

/// A whole number in [low, high].
inline int IndexOf(std::string_view word, int low, int high, const std::string& path, const std::string& where) {
  int value = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc() || end != word.data() + word.size() || value < low || value > high)
    throw FormatError(path, where, "must be a whole number from " + std::to_string(low) + " to " + std::to_string(high));
  return value;
}

}  // namespace mvstudio::body::internal
