#pragma once

#include <cstdlib>
#include <filesystem>

namespace mvstudio::testing {

/// Puts this program's temporary folders in memory where the system has such a place, for tests that write thousands of files.
inline bool TempFoldersInMemory() { return std::filesystem::is_directory("/dev/shm") && setenv("TMPDIR", "/dev/shm", 0) == 0; }

}  // namespace mvstudio::testing
