// Private: rows of a tile as vectors of the processor, for raster.cc and raster_backward.cc.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "avatar/metrics/simd.h"
#include "avatar/splats/raster.h"

namespace mvstudio::splats {

/// A row of a tile: kTilePx numbers, arithmetic on all at once (GCC's and clang's vector extensions).
template <class S>
struct RowOf;
template <>
struct RowOf<float> {
  using Type = float __attribute__((vector_size(sizeof(float) * kTilePx)));
  using Bits = int32_t __attribute__((vector_size(sizeof(int32_t) * kTilePx)));
};
template <>
struct RowOf<double> {
  using Type = double __attribute__((vector_size(sizeof(double) * kTilePx)));
  using Bits = int64_t __attribute__((vector_size(sizeof(int64_t) * kTilePx)));
};
template <class S>
using Row = typename RowOf<S>::Type;

/// exp of x in [-80, 0], relative error below 2e-7: 2^k times a polynomial of the rest, |rest| <= log(2) / 2.
MVS_INLINE void ExpRow(const Row<float>& x, Row<float>* out) {
  using Bits = RowOf<float>::Bits;
  const Bits k = __builtin_convertvector(x * 1.44269504f - 0.5f, Bits);  // to the nearest, for x <= 0
  const Row<float> whole = __builtin_convertvector(k, Row<float>);
  const Row<float> r = (x - whole * 0.693359375f) + whole * 2.12194440e-4f;
  Row<float> p = r * (1.f / 720) + 1.f / 120;
  p = p * r + 1.f / 24;
  p = p * r + 1.f / 6;
  p = p * r + 0.5f;
  p = p * r + 1.f;
  p = p * r + 1.f;
  const Bits power = (k + 127) << 23;
  *out = p * reinterpret_cast<Row<float>>(power);
}

MVS_INLINE void ExpRow(const Row<double>& x, Row<double>* out) {
  for (int l = 0; l < kTilePx; ++l) (*out)[l] = std::exp(x[l]);
}

template <class S>
MVS_INLINE S SumOf(const Row<S>& row) {
  return ((row[0] + row[4]) + (row[2] + row[6])) + ((row[1] + row[5]) + (row[3] + row[7]));
}

/// 0, 1, …, kTilePx - 1.
template <class S>
MVS_INLINE void Count(Row<S>* row) {
  for (int l = 0; l < kTilePx; ++l) (*row)[l] = S(l);
}

/// Whether some pixel of these rows still lets light through.
template <class S>
MVS_INLINE bool IsOpen(const Row<S>* through, int rows) {
  S most = 0;
  for (int y = 0; y < rows; ++y)
    for (int l = 0; l < kTilePx; ++l) most = std::max(most, through[y][l]);
  return most > S(kFullPixel);
}
inline constexpr int64_t kLookEvery = 16;  ///< splats between looks whether a tile is full

/// A splat in a tile: its distance from the tile's first pixel, and the rows that its box touches.
template <class S>
struct InTile {
  Row<S> dx;  // px, from the middle to each pixel of a row
  S y;        // px, of the middle below the first row
  int first, last;
};

template <class S>
MVS_INLINE void PlaceInTile(const Splat<S>& splat, int x0, int y0, int rows, InTile<S>* out) {
  Count<S>(&out->dx);
  out->dx = out->dx + (S(x0) - splat.x);
  out->y = splat.y - S(y0);
  out->first = static_cast<int>(std::ceil(std::max(out->y - splat.reach_y, S(0))));
  out->last = static_cast<int>(std::floor(std::min(out->y + splat.reach_y, S(rows - 1))));
}

/// exp(-d^T [a b; b c] d / 2) of the row that lies dy below the splat's middle, 0 where alpha falls below kLeastAlpha or the
/// pixel is full; alpha with it.
template <class S>
MVS_INLINE void AlphaRow(const Splat<S>& splat, const Row<S>& dx, S dy, const Row<S>& through, Row<S>* gauss, Row<S>* alpha) {
  Row<S> power = (dx * dx * splat.a + dy * dy * splat.c) * S(-0.5) - dx * (dy * splat.b);
  const Row<S> zero = power - power;
  power = power > zero ? zero : power;
  power = power < zero - S(80) ? zero - S(80) : power;
  ExpRow(power, gauss);
  *alpha = *gauss * splat.opacity;
  const auto counts = (*alpha >= zero + S(kLeastAlpha)) & (through > zero + S(kFullPixel));
  *gauss = counts ? *gauss : zero;
  *alpha = counts ? *alpha : zero;
  *alpha = *alpha > zero + S(kMostAlpha) ? zero + S(kMostAlpha) : *alpha;
}

}  // namespace mvstudio::splats
