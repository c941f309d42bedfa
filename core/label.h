#pragma once

#include <string>
#include <string_view>

namespace mvstudio {

/// Bytes of a camera's name in a calibration. With an ending it still names a file.
constexpr size_t kMaxLabelBytes = 200;

/// Empty when `name` can stand in a line of text and in a table; else why not: "is empty", "is longer than 200 bytes", "is not
/// UTF-8", "holds a control character". Whether it can name a file is another question.
std::string WhyNotALabel(std::string_view name, size_t max_bytes = kMaxLabelBytes);

}  // namespace mvstudio
