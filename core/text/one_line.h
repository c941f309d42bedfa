#pragma once

#include <string>

namespace mvstudio {

/// `text` as one line that a terminal can be shown: names and paths come from foreign files and may hold line breaks, escape
/// sequences or bytes that are no UTF-8; those become spaces and '?'. Longer than 4000 bytes, the middle is left out.
std::string OneLine(const std::string& text);

/// The same for text of many lines, whole: its line breaks stay.
std::string ManyLines(const std::string& text);

}  // namespace mvstudio
