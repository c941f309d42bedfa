// Private: nlohmann's JSON, for the reader and the writer of calibration.json.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "core/json_view.h"

namespace mvstudio::geometry::internal {

using Json = nlohmann::ordered_json;

inline std::string Shown(const std::string& text) { return JsonQuoted<Json>(text); }

}  // namespace mvstudio::geometry::internal
