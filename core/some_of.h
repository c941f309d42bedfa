#pragma once

#include <algorithm>
#include <cstddef>
#include <string>
#include <vector>

#include "core/join.h"

namespace mvstudio {

/// The first names of a list for a line of text, and how many there are besides: "a, b, c, and 7 more".
inline std::string SomeOf(const std::vector<std::string>& names, size_t shown = 8) {
  const auto end = names.begin() + static_cast<std::ptrdiff_t>(std::min(names.size(), shown));
  const std::string first = Join(std::vector<std::string>(names.begin(), end), ", ");
  return first + (names.size() > shown ? ", and " + std::to_string(names.size() - shown) + " more" : "");
}

}  // namespace mvstudio
