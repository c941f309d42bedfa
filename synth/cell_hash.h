#pragma once

#include <cstdint>

#include "core/random.h"

namespace mvstudio::synth {

/// A pseudo-random number in [0, 1) for the cell (x, y) of a pattern; the same on every machine.
inline float CellHash(uint64_t seed, int x, int y) {
  return static_cast<float>(
      Rng(seed ^ (static_cast<uint64_t>(static_cast<uint32_t>(x)) << 32) ^ static_cast<uint32_t>(y)).Uniform());
}

}  // namespace mvstudio::synth
