#pragma once

#include <cstdint>

namespace mvstudio {

/// Whether what is packed (deflate) takes far more memory than what anybody stores does. Arrays that are mostly empty pack by
/// some hundred times, and small ones are allowed all that deflate can do.
constexpr bool OutOfProportion(uint64_t unpacked_bytes, uint64_t packed_bytes) {
  constexpr uint64_t kAlwaysAllowed = uint64_t{1} << 28, kMostTimes = 400;
  return unpacked_bytes > kAlwaysAllowed && unpacked_bytes / kMostTimes > packed_bytes;
}

}  // namespace mvstudio
