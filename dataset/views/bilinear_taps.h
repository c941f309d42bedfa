// Private: the inner loop of crop_resample.cc.
#pragma once

#include <cmath>
#include <cstdint>

#if defined(__SSE2__)
#include <emmintrin.h>
#endif

#include "core/image.h"

/// Bilinear samples along a row of a resampled image, many at a time.
namespace mvstudio::dataset::internal {

inline constexpr int kMaxSamples = 16;         // a side
inline constexpr int kCoarsestStep = 32;       // pixels between knots
inline constexpr float kWeightUnit = 1 << 14;  // bilinear weights are integers that add up to this, within 2

// The cubic through values at -1, 0, 1, 2, as a polynomial in t.
struct Cubic {
  double c0, c1, c2, c3;
  Cubic(double a, double b, double c, double d)
      : c0(b), c1(c - a / 3 - b / 2 - d / 6), c2((a + c) / 2 - b), c3((d - a) / 6 + (b - c) / 2) {}
  double operator()(double t) const { return ((c3 * t + c2) * t + c1) * t + c0; }
};

// Four neighbouring pixels of the source and their weights.
struct Tap {
  int64_t at = -1;           // of the top-left one, in pixels; -1: outside the image
  int right = 0, below = 0;  // to the neighbours, in pixels: 0 at the border
  int16_t weights[4] = {};
};

// Adds the bilinear sample to sum[0 .. channels), in units of kWeightUnit.
inline void AddScalar(const uint8_t* pixels, int channels, const Tap& tap, int32_t* sum) {
  const uint8_t *a = pixels + tap.at * channels, *b = a + tap.right * channels, *c = a + tap.below * channels,
                *d = c + tap.right * channels;
  for (int k = 0; k < channels; ++k) {
    sum[k] += tap.weights[0] * a[k] + tap.weights[1] * b[k] + tap.weights[2] * c[k] + tap.weights[3] * d[k];
  }
}

// Taps of the samples of one cell in one row.
struct CellTaps {
  static constexpr int kMax = kCoarsestStep * kMaxSamples;
  int32_t at[kMax];               // of the top-left neighbour, in bytes
  uint32_t top[kMax], low[kMax];  // weights of two neighbours each, 16 bits a weight
  int32_t outside[kMax];          // 1: too near the border, not to be used
};

// True when all samples can be used. Positions are relative to the cell's, so that float suffices.
inline bool PlaceTaps(const Cubic& along_u, const Cubic& along_v, int count, float per_sample, const Image& source,
                      CellTaps* taps) {
  const double base_u = std::floor(along_u.c0), base_v = std::floor(along_v.c0);
  const float u0 = static_cast<float>(along_u.c0 - base_u), u1 = static_cast<float>(along_u.c1),
              u2 = static_cast<float>(along_u.c2), u3 = static_cast<float>(along_u.c3);
  const float v0 = static_cast<float>(along_v.c0 - base_v), v1 = static_cast<float>(along_v.c1),
              v2 = static_cast<float>(along_v.c2), v3 = static_cast<float>(along_v.c3);
  const float low_u = static_cast<float>(-base_u), high_u = static_cast<float>(source.width - 2 - base_u);
  const float low_v = static_cast<float>(-base_v), high_v = static_cast<float>(source.height - 3 - base_v);
  constexpr float kShift = 2048;  // keeps the argument of the truncation positive
  const int origin = (static_cast<int>(base_v) * source.width + static_cast<int>(base_u)) * source.channels;
  const int stride = source.width * source.channels;
  int any_outside = 0;
  for (int i = 0; i < count; ++i) {
    const float t = (static_cast<float>(i) + 0.5f) * per_sample;
    const float u = ((u3 * t + u2) * t + u1) * t + u0, v = ((v3 * t + v2) * t + v1) * t + v0;
    const int outside =
        static_cast<int>(u < low_u) | static_cast<int>(u > high_u) | static_cast<int>(v < low_v) | static_cast<int>(v > high_v);
    taps->outside[i] = outside, any_outside |= outside;
    const int x = static_cast<int>(u + kShift) - static_cast<int>(kShift);
    const int y = static_cast<int>(v + kShift) - static_cast<int>(kShift);
    const float fx = u - static_cast<float>(x), fy = (v - static_cast<float>(y)) * kWeightUnit, both = fx * fy;
    const int d = static_cast<int>(both + 0.5f), c = static_cast<int>(fy - both + 0.5f),
              b = static_cast<int>(fx * kWeightUnit - both + 0.5f), a = static_cast<int>(kWeightUnit) - b - c - d;
    taps->at[i] = origin + y * stride + x * source.channels;
    taps->top[i] = static_cast<uint32_t>(a & 0xffff) | static_cast<uint32_t>(b) << 16;
    taps->low[i] = static_cast<uint32_t>(c & 0xffff) | static_cast<uint32_t>(d) << 16;
  }
  return !any_outside;
}

inline int Low16(uint32_t pair) { return static_cast<int16_t>(pair & 0xffff); }
inline int High16(uint32_t pair) { return static_cast<int16_t>(pair >> 16); }

// Adds `samples` taps from `begin` on to sum[0 .. channels).
template <int kChannels>
void AddTaps(const Image& source, const CellTaps& taps, int begin, int samples, int32_t* sum) {
  const int stride = source.width * kChannels;
  for (int i = begin; i < begin + samples; ++i) {
    const uint8_t *a = source.pixels.data() + taps.at[i], *c = a + stride;
    for (int k = 0; k < kChannels; ++k) {
      sum[k] += Low16(taps.top[i]) * a[k] + High16(taps.top[i]) * a[k + kChannels] + Low16(taps.low[i]) * c[k] +
                High16(taps.low[i]) * c[k + kChannels];
    }
  }
}

#if defined(__SSE2__)
// The same; reads 8 bytes from each neighbour pair.
template <>
inline void AddTaps<3>(const Image& source, const CellTaps& taps, int begin, int samples, int32_t* sum) {
  const int stride = source.width * 3;
  const __m128i zero = _mm_setzero_si128();
  const auto weigh = [&zero](const uint8_t* p, uint32_t weights) {
    const __m128i pair = _mm_loadl_epi64(reinterpret_cast<const __m128i*>(p));
    const __m128i side_by_side = _mm_unpacklo_epi8(pair, _mm_srli_si128(pair, 3));  // r r' g g' b b'
    return _mm_madd_epi16(_mm_unpacklo_epi8(side_by_side, zero), _mm_set1_epi32(static_cast<int>(weights)));
  };
  __m128i total = _mm_loadu_si128(reinterpret_cast<const __m128i*>(sum));
  for (int i = begin; i < begin + samples; ++i) {
    const uint8_t* a = source.pixels.data() + taps.at[i];
    total = _mm_add_epi32(total, _mm_add_epi32(weigh(a, taps.top[i]), weigh(a + stride, taps.low[i])));
  }
  _mm_storeu_si128(reinterpret_cast<__m128i*>(sum), total);
}
#endif

}  // namespace mvstudio::dataset::internal
