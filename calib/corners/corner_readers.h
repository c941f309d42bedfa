// Private: the formats of ReadCornerFile, one reader each.
#pragma once

#include <string>
#include <utility>

#include "calib/corners/corner_files.h"

namespace mvstudio::calib::internal {

/// "640x480"; throws UsageError that begins with `what`.
std::pair<int, int> ParseSize(const std::string& text, const std::string& what);

CornerFile ReadVnl(const std::string& path, const CornerFileOptions& options);
CornerFile ReadCaliscope(const std::string& path, const CornerFileOptions& options);
CornerFile ReadOpenCvCorners(const std::string& path, const CornerFileOptions& options);
CornerFile ReadCornerCsv(const std::string& path, const CornerFileOptions& options);

}  // namespace mvstudio::calib::internal
