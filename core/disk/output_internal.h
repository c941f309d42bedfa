#pragma once

#include <functional>
#include <string>
#include <vector>

#include "core/disk/manifest.h"

namespace mvstudio::internal {

struct Replacement {
  std::string path;  ///< normal
  std::string temporary;
  FileDigest digest;
};

/// Writes the manifests and renames the temporaries into place. Call it under PublishMutex, with all of them flushed.
void Publish(const std::vector<Replacement>& files);

/// Removes what was replaced. The new result stands: a failure is tried once more, then it is a warning.
void RemoveOlder(const std::string& path, const std::function<void()>& remove);

/// `work` gets the name `path`, and what was there, if anything, the name `work`.
void SwapFolders(const std::string& work, const std::string& path);

/// Flushes everything that a manifest lists, and the folders.
void FlushTree(const std::string& folder, const Manifest& manifest);

/// The path, or the folder that it is a symbolic link to.
std::string FollowedFolder(const std::string& path);

}  // namespace mvstudio::internal
