// Private: nlohmann's JSON, for the .cc files of dataset/.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "core/error.h"
#include "core/json_view.h"

/// Checked access to JSON files.
namespace mvstudio::dataset::internal {

using Json = nlohmann::ordered_json;

/// Parses a text. Rejected: nesting deeper than 64, a repeated key in one object, numbers beyond the range of doubles,
/// bytes that are not UTF-8. "-0" keeps its sign. Throws FormatError with `path` and the byte of the syntax error, or the
/// place of the key; or of a NaN or an infinity, unless `missing_as_null`: then these words are null.
Json ParseJson(std::string_view text, const std::string& path, bool missing_as_null = false);

constexpr int64_t kMaxJsonBytes = int64_t{256} << 20;
/// The same for a regular file of at most `max_bytes`. Throws IoError, FormatError.
Json ParseJsonFile(const std::string& path, int64_t max_bytes = kMaxJsonBytes);
/// Content of a regular file of at most `max_bytes`. Throws IoError, FormatError.
std::string ReadTextFile(const std::string& path, int64_t max_bytes);

using JsonView = BasicJsonView<Json>;

/// A text that is valid as a camera's name (core/label.h).
std::string CameraName(const JsonView& json);

/// Shortest text that parses to the same double.
std::string NumberText(double value);

/// Same in the form of a C++ stream: six significant digits where they suffice, more where they do not.
std::string StreamNumberText(double value);

/// Text from outside for a message: in quotes, on one line, at most 60 bytes of it.
std::string Quoted(const std::string& text);

}  // namespace mvstudio::dataset::internal
