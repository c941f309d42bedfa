#pragma once

#include <functional>
#include <string>
#include <string_view>

namespace mvstudio {

/// "a, b, c": the items separated by `between`; `text` converts each: a function or a member.
template <class Items, class Text>
std::string Join(const Items& items, std::string_view between, const Text& text) {
  std::string all;
  bool first = true;
  for (const auto& item : items) {
    if (!first) all += between;
    all += std::invoke(text, item);
    first = false;
  }
  return all;
}

/// Same for strings.
template <class Items>
std::string Join(const Items& items, std::string_view between) {
  return Join(items, between, [](const auto& item) -> std::string_view { return item; });
}

}  // namespace mvstudio
