#pragma once

#include <optional>
#include <string>

namespace mvstudio::report {

/// `path`, absolute or relative to `folder`, with its symbolic links followed one by one; nothing where it leads out of the
/// folder. Outside nothing is looked at, so that the answer does not tell what is there. The end of the path need not exist.
std::optional<std::string> InsideFolder(const std::string& folder, const std::string& path);

}  // namespace mvstudio::report
