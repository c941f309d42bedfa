#pragma once

#include <string>

namespace mvstudio {

/// `text` with absurdly long numbers ("%f" of 1e300 has 300 digits) in their short form, "1e+300": for messages.
std::string ShortNumbers(std::string text);

/// Like printf, of any length, with ShortNumbers.
std::string Format(const char* format, ...) __attribute__((format(printf, 1, 2)));

}  // namespace mvstudio
