#pragma once

#include <string>

/// Programs with sanitizers are slower and reserve terabytes of address space.
namespace mvstudio::testing {

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr bool kSanitized = true;
#else
inline constexpr bool kSanitized = false;
#endif

/// Shell words that bound the memory of what follows them: its address space, or with sanitizers what is resident.
inline std::string MemoryBound(int megabytes) {
  const std::string resident = "hard_rss_limit_mb=" + std::to_string(megabytes);
  if (kSanitized) return "export ASAN_OPTIONS=" + resident + " TSAN_OPTIONS=\"$TSAN_OPTIONS:" + resident + "\"; ";
  return "ulimit -v " + std::to_string(megabytes * 1024) + "; ";
}

}  // namespace mvstudio::testing
