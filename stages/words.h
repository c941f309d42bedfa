#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

/// Parses arguments that name files and numbers, and writes numbers as people read them.
namespace mvstudio::stages {

/// Splits "name=path"; throws UsageError naming `flag` when there is no '='.
std::pair<std::string, std::string> SplitNamePath(const std::string& flag, const std::string& text);

/// "NAME=PATH": what lies where for the camera of this name. As an option, see core/fields.h.
struct NamedPath {
  std::string name, path;
};
std::string ToString(const NamedPath& named);
void FromString(const std::string& text, const std::string& option, NamedPath* named);

/// Parses "80-99" or "1,4,7-9" into sorted numbers; throws UsageError.
std::vector<int> ParseRanges(const std::string& flag, const std::string& text);
/// A length in the unit of its size: "12.3 um" below 0.1 mm, "4.56 mm", "1.23 m"; "unknown" for NaN. Not for tables, whose rows
/// share a unit.
std::string LengthText(double metres);
/// "1 error", "2 errors".
std::string Counted(int64_t count, const std::string& thing);
/// The shortest text that ParseRanges converts to these sorted numbers: "1,4,7-9".
std::string RangesText(const std::vector<int>& numbers);

}  // namespace mvstudio::stages
