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

/// Absolute path without `.`, `..` and trailing slashes; symbolic links are not resolved.
std::string Normal(const std::string& path);

}  // namespace mvstudio::internal
