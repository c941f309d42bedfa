#pragma once

#include <string>
#include <string_view>

namespace mvstudio {

/// Maximum bytes of a camera's name in a calibration. With a suffix it is still a valid file name.
constexpr size_t kMaxLabelBytes = 200;

/// Why `name` cannot be used in a line of text and in a table; empty if it can: "is empty", "is longer than 200 bytes",
/// "is not UTF-8", "holds a control character". Does not check whether it is a valid file name.
std::string WhyNotALabel(std::string_view name, size_t max_bytes = kMaxLabelBytes);

}  // namespace mvstudio
