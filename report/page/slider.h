#pragma once

#include <string_view>

namespace mvstudio::report {

/// Puts a slider above each strip of `data-compared`: left of its border the first of the strip's square images is seen, right
/// of it the second. Without the script the strips are as they were.
std::string_view SliderScript();

}  // namespace mvstudio::report
