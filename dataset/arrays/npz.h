#pragma once

#include <cstddef>
#include <map>
#include <string>

#include "core/disk/npy.h"

namespace mvstudio::dataset {

/// Most bytes that the members of an archive may hold together.
inline constexpr size_t kMaxNpzBytes = size_t{1} << 31;

/// The arrays of numpy's .npz (numpy.savez, savez_compressed) as the bytes of their .npy files, by name without `.npy`.
/// Throws IoError; FormatError, naming the member, for damaged archives, members that are no plain .npy files or are there
/// twice, and sizes beyond `max_bytes`.
std::map<std::string, std::string> ReadNpzMembers(const std::string& path, size_t max_bytes = kMaxNpzBytes);
std::map<std::string, std::string> ParseNpzMembers(const std::string& bytes, const std::string& path,
                                                   size_t max_bytes = kMaxNpzBytes);

/// Same for archives of numbers alone. The errors of ParseNpy name the member, too.
std::map<std::string, NpyArray> ReadNpz(const std::string& path);
std::map<std::string, NpyArray> ParseNpz(const std::string& bytes, const std::string& path);

}  // namespace mvstudio::dataset
