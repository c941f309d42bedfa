// Private: a step of VideoReader.
#pragma once

struct AVPacket;

namespace mvstudio::dataset::internal {

/// Verifies the checksums of FFV1, version 3 and later: libav's decoder only logs a mismatch.
class SliceChecksums {
 public:
  bool IsDamaged(const AVPacket& packet);

 private:
  bool present_ = false;  ///< an earlier packet had them
};

}  // namespace mvstudio::dataset::internal
