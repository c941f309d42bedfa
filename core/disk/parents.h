// Private: for the .cc files of this folder.
#pragma once

#include <string>
#include <vector>

/// The folders above a path, and its normal form.
namespace mvstudio::internal {

/// Folder of a path; "." when it names none.
std::string ParentOf(const std::string& path);

/// Creates the parent folder of a path; returns the folders created, outermost first.
std::vector<std::string> MakeParents(const std::string& path);
/// Removes those that are empty.
void RemoveEmpty(const std::vector<std::string>& folders);

/// Absolute path without `.`, `..` and trailing slashes, of the place that the system finds: links of the parents are
/// followed, not that of the last part unless a slash or a dot is behind it. Throws IoError where a parent leads nowhere.
std::string Normal(const std::string& path);
/// Same, but a relative path stays one.
std::string OneName(const std::string& path);
/// Same, of a file: throws UsageError for a path that is empty or a folder's.
std::string NameOfFile(const std::string& path);

}  // namespace mvstudio::internal
