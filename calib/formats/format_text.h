// Private: for the readers and writers of calib/.
#pragma once

#include <Eigen/Core>
#include <string>
#include <string_view>

/// Numbers and texts as several formats have them, and the place of one in its file.
namespace mvstudio::calib::internal {

/// Where a value was read, for FormatError.
struct Place {
  std::string path, where;
};

/// At most 40 characters of foreign text for a message, with '?' for whatever is not printable ASCII.
std::string Printable(std::string_view text);

/// Parses all of `text` as a number; throws FormatError otherwise.
double ParseNumber(std::string_view text, const Place& place);

/// Shortest text that parses to the same number, with a '.' or an exponent.
std::string NumberText(double value);
/// `[1.0, 2.0]`.
std::string ListText(const Eigen::VectorXd& vector);
/// `"text"` with backslash escapes for JSON, TOML and YAML. Throws UsageError for control characters.
std::string Quoted(const std::string& text);

/// Returns `name` if it is a valid file name; throws UsageError otherwise.
const std::string& FileName(const std::string& name);

/// JSON of cameras by name, as AvatarReX has it (ReadOpenCvYaml).
bool HoldsCamerasByName(std::string_view text);

/// Without folders and extension.
std::string Stem(const std::string& path);

}  // namespace mvstudio::calib::internal
