#include "core/format.h"

#include <algorithm>
#include <cstdarg>
#include <cstdio>

#include "core/check.h"

namespace mvstudio {

std::string Format(const char* format, ...) {
  va_list values, again;
  va_start(values, format);
  va_copy(again, values);
  char head[256];
  const int size = std::vsnprintf(head, sizeof head, format, values);
  va_end(values);
  std::string text(head, static_cast<size_t>(std::clamp<int>(size, 0, sizeof head - 1)));
  if (size >= static_cast<int>(sizeof head)) {
    text.resize(static_cast<size_t>(size));
    std::vsnprintf(text.data(), text.size() + 1, format, again);
  }
  va_end(again);
  MVS_CHECK(size >= 0, "format " << format);
  return text;
}

}  // namespace mvstudio
