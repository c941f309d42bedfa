#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace mvstudio {

/// An array of numpy's .npy format (versions 1 to 3; numpy.lib.format), row by row.
struct NpyArray {
  std::vector<int64_t> shape;
  std::vector<double> values;
};

/// Reads little-endian float16, float32, float64 and integers of 8 to 64 bits, C or Fortran order. Throws IoError;
/// FormatError for other types (objects are never unpickled), damaged headers, and sizes that exceed the file.
NpyArray ReadNpy(const std::string& path);
NpyArray ParseNpy(const std::string& bytes, const std::string& path);

/// Bytes that a .npy file has by its header, which `head` must hold whole; nothing where that does not say so: objects,
/// records, what is no .npy file.
std::optional<uint64_t> NpyFileBytes(const std::string& head);

/// A 1-D array of text, dtype `<U…`, as UTF-8. Throws FormatError for other types and shapes, and for what is no character.
std::vector<std::string> ParseNpyTexts(const std::string& bytes, const std::string& path);

/// Whether what is packed (deflate) takes far more memory than what anybody stores does. Arrays that are mostly empty pack by
/// some hundred times, and small ones are allowed all that deflate can do.
constexpr bool OutOfProportion(uint64_t unpacked_bytes, uint64_t packed_bytes) {
  constexpr uint64_t kAlwaysAllowed = uint64_t{1} << 28, kMostTimes = 400;
  return unpacked_bytes > kAlwaysAllowed && unpacked_bytes / kMostTimes > packed_bytes;
}

}  // namespace mvstudio
