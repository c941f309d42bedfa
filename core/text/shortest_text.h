#pragma once

#include <charconv>
#include <string>

namespace mvstudio {

/// Appends the shortest text that parses to the same float or double: "0.1", "1e+30", "nan", "inf".
template <class Number>
void AppendShortestText(Number value, std::string* text) {
  char digits[32];  // a double needs 24 at most
  text->append(digits, std::to_chars(digits, digits + sizeof digits, value).ptr);
}

template <class Number>
std::string ShortestText(Number value) {
  std::string text;
  AppendShortestText(value, &text);
  return text;
}

}  // namespace mvstudio
