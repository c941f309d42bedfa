#pragma once

/// A function compiled twice, the one that the processor has is chosen at start. No fused multiply-add in either: machines
/// agree to the last bit. What such a function calls must be inlined into it: MVS_INLINE.
#define MVS_SIMD __attribute__((target_clones("avx2", "default")))
#define MVS_INLINE inline __attribute__((always_inline))
