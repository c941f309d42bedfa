#pragma once

#include <string>

namespace mvstudio {

/// `text` with absurdly long numbers ("%f" of 1e300 has 300 digits) in their short form, "1e+300": for messages.
std::string ShortNumbers(std::string text);

}  // namespace mvstudio
