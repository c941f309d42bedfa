#include "avatar/data/safetensors_header.h"
#include "tests/fuzz/fuzz.h"

/// Safetensors: everything but the copying into tensors.
namespace mvstudio::fuzz {

MVS_FUZZ_TARGET(safetensors, bytes) {
  using namespace avatar::internal;
  TensorLayout layout;
  Accepts([&] { ParseTensorLayout(bytes, true, "a.safetensors"); });
  if (!Accepts([&] { layout = ParseTensorLayout(bytes, false, "a.safetensors"); })) return;
  uint64_t total = 0;
  for (const auto& [name, entry] : layout.header.entries) {
    uint64_t size = ElementSize(entry.type);
    for (const int64_t side : entry.shape) size *= static_cast<uint64_t>(side);
    Require(entry.begin <= entry.end && entry.end <= bytes.size() - layout.data_at, "a tensor beyond the file");
    Require(size == entry.end - entry.begin, "a tensor of another size than its shape needs");
    total += size;
  }
  Require(total == bytes.size() - layout.data_at, "bytes that belong to no tensor");
  const std::string text = HeaderText(layout.header);
  std::string again(8, '\0');
  for (size_t i = 0; i < 8; ++i) again[i] = static_cast<char>(text.size() >> (8 * i));
  again += text + std::string(total, '\0');
  TensorLayout back;
  Require(Accepts([&] { back = ParseTensorLayout(again, false, "b.safetensors"); }), "what was written cannot be read");
  Require(HeaderText(back.header) == text, "the header changes when it is read and written again");
}

}  // namespace mvstudio::fuzz
