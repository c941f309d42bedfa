#pragma once

#include <string_view>

namespace mvstudio {

/// Bytes of the well-formed UTF-8 character that begins at `at`; 0 when there is none. Overlong forms, surrogates and
/// numbers beyond U+10FFFF are not well-formed.
size_t Utf8Length(std::string_view text, size_t at);

bool IsUtf8(std::string_view text);

}  // namespace mvstudio
