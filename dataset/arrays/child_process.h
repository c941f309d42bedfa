// Private: for the files of packs from others; it forks the process. core/process.h starts programs; this runs a function of
// this program on its data.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

namespace mvstudio::dataset::internal {

struct ChildLimits {
  double deadline_s = 30;
  uint64_t max_memory_bytes = 1ull << 30;  ///< beyond what the process already uses
};

/// Runs `work` in a copy of this process with limits on memory, processor time and wall time, and returns its text. Its
/// exceptions are rethrown here (IoError, FormatError, ResourceError and UsageError as such). A child that crashes or
/// exceeds memory or time is a FormatError that names `path`. It ends when this process ends, however that happens.
std::string RunInChild(const std::string& path, const ChildLimits& limits, const std::function<std::string()>& work);

}  // namespace mvstudio::dataset::internal
