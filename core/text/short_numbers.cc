#include "core/text/short_numbers.h"

#include <cctype>
#include <cstdio>
#include <cstdlib>

namespace mvstudio {
namespace {

bool IsDigit(char c) { return std::isdigit(static_cast<unsigned char>(c)) != 0; }

size_t EndOfDigits(const std::string& text, size_t at) {
  while (at < text.size() && IsDigit(text[at])) ++at;
  return at;
}

}  // namespace

std::string ShortNumbers(std::string text) {
  constexpr size_t kMostDigits = 20, kMostOfWhole = 40;  // a name of digits alone may be longer than a number with a fraction
  for (size_t at = 0; at < text.size(); ++at) {
    if (!IsDigit(text[at])) continue;
    const size_t whole = EndOfDigits(text, at);
    const bool fraction = whole + 1 < text.size() && text[whole] == '.' && IsDigit(text[whole + 1]);
    const size_t end = fraction ? EndOfDigits(text, whole + 1) : whole;
    const char before = at > 0 ? text[at - 1] : ' ';
    const bool in_word = std::isalnum(static_cast<unsigned char>(before)) || before == '_' || before == '/' || before == '.';
    if (!in_word && whole - at > (fraction ? kMostDigits : kMostOfWhole)) {
      char digits[32];
      std::snprintf(digits, sizeof digits, "%.6g", std::strtod(text.substr(at, end - at).c_str(), nullptr));
      text.replace(at, end - at, digits);
      at += std::string(digits).size() - 1;
    } else {
      at = end - 1;
    }
  }
  return text;
}

}  // namespace mvstudio
