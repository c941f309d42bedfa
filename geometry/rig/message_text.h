// Private: nlohmann's JSON, for the reader and the writer of calibration.json.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace mvstudio::geometry::internal {

using Json = nlohmann::ordered_json;

/// Text from outside on one line, at most 60 bytes of it.
inline std::string Escaped(const std::string& text) {
  constexpr size_t kMaxBytes = 60;
  const std::string shown = Json(text.substr(0, kMaxBytes)).dump(-1, ' ', true, Json::error_handler_t::replace);
  return shown.substr(1, shown.size() - 2) + (text.size() > kMaxBytes ? "…" : "");
}

inline std::string Shown(const std::string& text) { return "'" + Escaped(text) + "'"; }

}  // namespace mvstudio::geometry::internal
