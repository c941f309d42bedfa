#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

/// The compression function of SHA-256 over whole blocks of 64 bytes: for core/sha256 and its tests.
namespace mvstudio::internal {

using Sha256State = std::array<uint32_t, 8>;

void CompressPortable(Sha256State& state, const uint8_t* blocks, size_t count);

/// Whether this machine has SHA instructions; only then may CompressWithInstructions be called.
bool HasShaInstructions();
void CompressWithInstructions(Sha256State& state, const uint8_t* blocks, size_t count);

/// Uses the faster of the two.
void CompressBlocks(Sha256State& state, const uint8_t* blocks, size_t count);

}  // namespace mvstudio::internal
