#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

/// numpy's files, written byte by byte: .npy (format 1.0, numpy.lib.format) and .npz (an uncompressed ZIP archive).
namespace mvstudio {

/// A `.npy` of little-endian doubles, row by row.
std::string NpyOfDoubles(const std::vector<size_t>& shape, const std::vector<double>& values);
/// Single precision.
std::string NpyOfFloats(const std::vector<size_t>& shape, const std::vector<float>& values);
std::string NpyOfInts(const std::vector<size_t>& shape, const std::vector<int64_t>& values);
/// A 1-D array of text, dtype `<U…`. Throws UsageError for text that is not UTF-8.
std::string NpyOfTexts(const std::vector<std::string>& texts);

/// ZIP archive of stored members, the form of numpy.savez; names without `.npy`. Throws UsageError beyond 4 GiB or 65,535
/// members.
std::string NpzOf(const std::vector<std::pair<std::string, std::string>>& members);

/// What comes before the data of a `.npy`, for types that the functions above do not write: magic, version and the header,
/// padded so that the data start at a multiple of 64.
std::string NpyHeader(const std::string& descr, const std::vector<size_t>& shape);

}  // namespace mvstudio
