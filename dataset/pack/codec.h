#pragma once

#include <string>

namespace mvstudio::dataset {

/// Encoding of a pack's images.
struct PackCodec {
  enum class Kind { kPng, kJpeg, kRaw };  ///< kRaw: rows of RGB bytes
  Kind kind = Kind::kPng;
  int quality = 0;  ///< kJpeg: 1 to 100
};
std::string ToString(const PackCodec& codec);  ///< "png", "jpeg:Q", "raw"
/// Throws UsageError.
void FromString(const std::string& text, PackCodec* codec);

}  // namespace mvstudio::dataset
