#pragma once

/// A function compiled twice; the version for the processor is selected at start. Neither uses fused multiply-add, so that
/// machines agree to the last bit. Functions called from it must be inlined: MVS_INLINE.
#define MVS_SIMD __attribute__((target_clones("avx2", "default")))
#define MVS_INLINE inline __attribute__((always_inline))
