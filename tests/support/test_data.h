#pragma once

#include <cstdlib>
#include <filesystem>
#include <string>

namespace mvstudio::testing {

/// Folder of the recordings: MVSTUDIO_DATA, else shared/data beside the project.
inline std::string DataRoot() {
  if (const char* root = std::getenv("MVSTUDIO_DATA")) return root;
  const char* source = std::getenv("MVSTUDIO_SOURCE");
  return (std::filesystem::path(source ? source : ".") / "../shared/data").lexically_normal().string();
}

inline bool HasData(const std::string& set) { return std::filesystem::exists(DataRoot() + "/" + set); }

}  // namespace mvstudio::testing

/// Skips the test with a message that names the set when it is not there.
#define MVS_NEEDS_DATA(set)                                                                                  \
  if (!::mvstudio::testing::HasData(set)) {                                                                  \
    GTEST_SKIP() << "needs the recording set '" << set << "' (set MVSTUDIO_DATA to the folder that has it)"; \
  }
