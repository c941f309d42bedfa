#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "core/disk/kept.h"
#include "core/image.h"

/// What is kept of footage until a run that was cut is done again.
namespace mvstudio::stages {

/// Frames of a camera that are kept together. Each block begins by itself, without the frame before: blocks can be made in any
/// order and on several machines.
inline constexpr int64_t kKeptBlock = 300;

/// Digest of the content of footage; beyond 2 GiB, of names, sizes and times. It is kept in `cache` and not read again as long
/// as names, sizes and times are the same. Nothing where the footage is not there or cannot be read.
std::optional<std::string> FootageDigest(const CachePlace& cache, const std::string& path);

/// BASE/000012: the kept results of a camera lie in one folder.
std::string BlockKey(const std::string& base, int64_t block);

void PutImage(const Image& image, KeptWriter* out);
/// Throws DamagedBytes.
Image GetImage(KeptReader* in);

}  // namespace mvstudio::stages
