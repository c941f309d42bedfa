#pragma once

#include <cstdio>
#include <string>

namespace mvstudio::app {

/// As printf, at most 511 bytes.
template <class... Values>
std::string Format(const char* format, Values... values) {
  char line[512];
  std::snprintf(line, sizeof line, format, values...);
  return line;
}

}  // namespace mvstudio::app
