#pragma once

#include <functional>
#include <string>
#include <string_view>
#include <vector>

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

/// What stands between commas; empty parts are left out.
inline std::vector<std::string> SplitCommas(std::string_view text) {
  std::vector<std::string> parts;
  while (!text.empty()) {
    const size_t end = text.find(',');
    if (end > 0) parts.emplace_back(text.substr(0, end));
    text.remove_prefix(end < text.size() ? end + 1 : text.size());
  }
  return parts;
}

}  // namespace mvstudio
