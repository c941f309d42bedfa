#include "core/hash/sha256.h"

#include <algorithm>
#include <cstring>
#include <fstream>
#include <vector>

#include "core/error.h"
#include "core/hash/sha256_blocks.h"

namespace mvstudio {

void Sha256::Update(const void* data, size_t size) {
  const auto* bytes = static_cast<const uint8_t*>(data);
  while (size > 0) {
    const size_t used = total_ % 64;
    if (used == 0 && size >= 64) {  // without a copy
      const size_t blocks = size / 64;
      internal::CompressBlocks(state_, bytes, blocks);
      total_ += 64 * blocks, bytes += 64 * blocks, size -= 64 * blocks;
      continue;
    }
    const size_t take = std::min(size, 64 - used);
    std::memcpy(buffer_.data() + used, bytes, take);
    total_ += take, bytes += take, size -= take;
    if (total_ % 64 == 0) internal::CompressBlocks(state_, buffer_.data(), 1);
  }
}

std::string Sha256::HexDigest() {
  const uint64_t bits = total_ * 8;
  const uint8_t one = 0x80, zero = 0;
  Update(&one, 1);
  while (total_ % 64 != 56) Update(&zero, 1);
  std::array<uint8_t, 8> length;
  for (int i = 0; i < 8; ++i) length[i] = static_cast<uint8_t>(bits >> (56 - 8 * i));
  Update(length.data(), 8);
  std::string hex;
  for (uint32_t word : state_) {
    for (int shift = 28; shift >= 0; shift -= 4) hex += "0123456789abcdef"[(word >> shift) & 15];
  }
  return hex;
}

std::string Sha256Hex(const void* data, size_t size) {
  Sha256 hash;
  hash.Update(data, size);
  return hash.HexDigest();
}

std::string Sha256File(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  if (!in) throw IoError(path, "cannot open");
  Sha256 hash;
  std::vector<char> piece(1 << 20);
  while (in.read(piece.data(), static_cast<std::streamsize>(piece.size())) || in.gcount() > 0) {
    hash.Update(piece.data(), static_cast<size_t>(in.gcount()));
  }
  if (in.bad()) throw IoError(path, "cannot be read to its end");
  return hash.HexDigest();
}

}  // namespace mvstudio
