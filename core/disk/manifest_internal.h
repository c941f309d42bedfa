#pragma once

#include <string>
#include <utility>
#include <vector>

#include "core/disk/manifest.h"

namespace mvstudio::internal {

/// Writes down, before it happens, that these files are about to be replaced. Call it under PublishMutex.
void RecordWrites(const std::vector<std::pair<std::string, FileDigest>>& files);

/// A manifest into its folder, atomically; the folder's own lock must be held where others may write it, too.
void WriteManifest(const Manifest& manifest, const std::string& folder);

/// Everything that stands in a folder, with digests, as a manifest.
Manifest TakeInventory(const std::string& folder);

}  // namespace mvstudio::internal
