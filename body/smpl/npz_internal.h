#pragma once

#include <map>
#include <string>
#include <vector>

#include "core/disk/npy.h"

namespace mvstudio::body::internal {

/// Those of the named arrays that a numpy .npz file has; others, which may hold objects, are not looked at.
std::map<std::string, NpyArray> ArraysFromNpz(const std::string& bytes, const std::string& path,
                                              const std::vector<std::string>& names);

}  // namespace mvstudio::body::internal
