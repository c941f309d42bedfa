#pragma once

#include <string_view>

namespace mvstudio::report {

/// Puts a slider above each strip of `data-compared`: left of its border the first of the strip's square images is seen, right
/// of it the second. Above a `.beside` it lies between its first two images. Without the script all are as they were.
std::string_view SliderScript();

}  // namespace mvstudio::report
