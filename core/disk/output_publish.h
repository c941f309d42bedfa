// Private: the steps of publishing, for output*.cc.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "core/disk/manifest.h"

namespace mvstudio::internal {

struct Replacement {
  std::string path;  ///< absolute, without `.` and `..`
  std::string temporary;
  FileDigest digest;
};

/// Writes the manifests and renames the temporaries into place. Call it under PublishMutex, with all of them flushed.
void Publish(const std::vector<Replacement>& files);

/// Removes what was replaced. The new result is kept: a failure is retried once, then it is a warning.
void RemoveOlder(const std::string& path, const std::function<void()>& remove);

/// `work` is renamed to `path`, and the previous content of `path`, if any, to `work`.
void SwapFolders(const std::string& work, const std::string& path);

/// Flushes everything that a manifest lists, and the folders.
void FlushTree(const std::string& folder, const Manifest& manifest);

/// The path, or the folder to which it is a symbolic link.
std::string FollowedFolder(const std::string& path);

}  // namespace mvstudio::internal
