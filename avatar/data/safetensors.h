#pragma once

#include <ATen/core/Tensor.h>

#include <map>
#include <string>

namespace mvstudio::avatar {

/// The content of a safetensors file: named tensors and string metadata.
struct TensorFile {
  std::map<std::string, at::Tensor> tensors;    ///< on the CPU, contiguous
  std::map<std::string, std::string> metadata;  ///< __metadata__ without the digests
};

/// Writes the safetensors layout (8-byte little-endian header size, JSON header, data), atomically. __metadata__ holds a
/// SHA-256 of every tensor's bytes as `sha256.<name>`, and one over all names, types, shapes and metadata as `sha256.`.
/// Types: uint8, int8, int16, int32, int64, float16, bfloat16, float32, float64, bool.
void WriteTensorFile(const TensorFile& file, const std::string& path);

/// Reads such a file. The header is at most 100 MB, sizes are multiplied with overflow checks, data ranges must be
/// contiguous from 0 and end at the end of the file. Digests must match where present; `require_digests` rejects files
/// without (such as those of other programs). Throws IoError, or FormatError naming the tensor.
TensorFile ReadTensorFile(const std::string& path, bool require_digests = true);

}  // namespace mvstudio::avatar
