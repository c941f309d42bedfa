#pragma once

#include <string>

namespace mvstudio {

/// Like printf, of any length.
std::string Format(const char* format, ...) __attribute__((format(printf, 1, 2)));

}  // namespace mvstudio
