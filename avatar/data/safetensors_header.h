#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

/// The header of a safetensors file: read, checked and written without libtorch.
namespace mvstudio::avatar::internal {

inline constexpr uint64_t kMaxHeaderBytes = 100'000'000;
inline constexpr char kDigestPrefix[] = "sha256.";

struct TensorEntry {
  std::string type;  ///< "F32", …
  std::vector<int64_t> shape;
  uint64_t begin = 0, end = 0;  ///< bytes, from the end of the header
};

struct TensorHeader {
  std::map<std::string, TensorEntry> entries;
  std::map<std::string, std::string> metadata;  ///< __metadata__, digests included
};

/// Bytes per element; 0 for types that the format lacks.
uint64_t ElementSize(const std::string& type);

/// Digest of everything but the tensors' bytes.
std::string DigestOfHeader(const TensorHeader& header);

/// The JSON text, padded with blanks to a multiple of 8 bytes.
std::string HeaderText(const TensorHeader& header);

struct TensorLayout {
  TensorHeader header;
  size_t data_at = 0;                          ///< offset of the data in the file
  std::map<std::string, std::string> digests;  ///< tensor -> SHA-256, for tensors that have one
};

/// Parses the header of a whole file: at most 100 MB; every tensor's range matches its shape; ranges are contiguous and
/// end at the end of the file. If there are digests, that of the header must match; `require_digests` rejects files
/// without. Throws FormatError naming the tensor.
TensorLayout ParseTensorLayout(std::string_view content, bool require_digests, const std::string& path);

}  // namespace mvstudio::avatar::internal
