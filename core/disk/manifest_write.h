// Private: for output*.cc and manifest*.cc, which hold the locks that these need.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "core/disk/manifest.h"

namespace mvstudio::internal {

/// Records that these files are about to be replaced, before it happens. Call it under PublishMutex.
void RecordWrites(const std::vector<std::pair<std::string, FileDigest>>& files);

/// Writes a manifest to its folder, atomically; hold the folder's lock where other processes may write it too.
void WriteManifest(const Manifest& manifest, const std::string& folder);

/// A manifest of everything in a folder, with digests.
Manifest TakeInventory(const std::string& folder);

/// Gives a folder, in which all is known to be ours, a list of its own where that was known from the lists of folders above.
void ListWithin(const std::string& folder);

}  // namespace mvstudio::internal
