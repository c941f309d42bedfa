#include "avatar/scores/vector_kernels.h"

#include "avatar/metrics/simd.h"

namespace mvstudio::avatar {
namespace {

/// Four numbers wherever they lie.
typedef double Four __attribute__((vector_size(32), aligned(8), may_alias));

MVS_INLINE const Four& At(const double* p) { return *reinterpret_cast<const Four*>(p); }

template <int kCount>
MVS_INLINE void DotsOf(const double* first, int64_t stride, const double* v, int64_t length, double* out) {
  Four sums[kCount] = {}, more[kCount] = {};
  int64_t i = 0;
  for (; i + 8 <= length; i += 8) {
    for (int k = 0; k < kCount; ++k) {
      const double* p = first + k * stride + i;
      sums[k] += At(p) * At(v + i);
      more[k] += At(p + 4) * At(v + i + 4);
      __builtin_prefetch(p + kCount * stride);  // the vectors after these
    }
  }
  for (int k = 0; k < kCount; ++k) {
    const Four s = sums[k] + more[k];
    out[k] = s[0] + s[1] + (s[2] + s[3]);
    for (int64_t rest = i; rest < length; ++rest) out[k] += first[k * stride + rest] * v[rest];
  }
}

template <int kCount>
MVS_INLINE void SubtractOf(const double* first, int64_t stride, const double* weights, int64_t length, double* out) {
  int64_t i = 0;
  for (; i + 4 <= length; i += 4) {
    Four sum = At(out + i);
    for (int k = 0; k < kCount; ++k) sum -= At(first + k * stride + i) * weights[k];
    *reinterpret_cast<Four*>(out + i) = sum;
  }
  for (; i < length; ++i) {
    for (int k = 0; k < kCount; ++k) out[i] -= first[k * stride + i] * weights[k];
  }
}

}  // namespace

MVS_SIMD void Dots(const Vectors& vectors, const double* v, int64_t length, double* out) {
  int64_t k = 0;
  for (; k + 4 <= vectors.count; k += 4) DotsOf<4>(vectors.first + k * vectors.stride, vectors.stride, v, length, out + k);
  for (; k < vectors.count; ++k) DotsOf<1>(vectors.first + k * vectors.stride, vectors.stride, v, length, out + k);
}

MVS_SIMD void SubtractCombination(const Vectors& vectors, const double* weights, int64_t length, double* out) {
  int64_t k = 0;
  for (; k + 4 <= vectors.count; k += 4)
    SubtractOf<4>(vectors.first + k * vectors.stride, vectors.stride, weights + k, length, out);
  for (; k < vectors.count; ++k) SubtractOf<1>(vectors.first + k * vectors.stride, vectors.stride, weights + k, length, out);
}

}  // namespace mvstudio::avatar
