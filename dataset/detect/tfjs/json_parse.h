// Private: nlohmann's JSON, for the .cc files of detect/.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "core/error.h"
#include "core/json_view.h"

/// Checked access to the JSON of this module's files.
namespace mvstudio::detect::internal {

using Json = nlohmann::json;

/// Nesting deeper than 64 is rejected. Throws FormatError with the byte of the syntax error.
Json ParseJson(const std::string& path, const std::string& text);

using JsonView = BasicJsonView<Json>;

/// Bytes of base64 text (RFC 4648, with padding). Throws FormatError.
std::string DecodeBase64(const std::string& path, const std::string& where, const std::string& text);

}  // namespace mvstudio::detect::internal
