#include "avatar/splats/lanes.h"
#include "avatar/splats/raster.h"
#include "core/parallel.h"

namespace mvstudio::splats {
namespace {

/// One tile, and the derivatives of its pixels; pixels outside the image have none.
template <class S>
struct BackwardTile {
  const Splat<S>* splats;
  const int* list;
  int64_t count;
  int x0, y0, rows;
  Row<S> by_rgb[kTilePx][3], by_alpha[kTilePx];
  Row<S> rest[kTilePx];  // derivative-weighted light of the splats that are still to come
};

template <class S>
struct RowSums {
  Row<S> rgb[3] = {}, opacity = {}, power = {}, power_x = {}, power_xx = {}, power_y = {}, power_xy = {}, power_yy = {};
};

/// Adds one row's share: `through` is the light that reaches the splat there.
template <class S>
MVS_INLINE void AddRow(const Splat<S>& splat, const Row<S>& dx, S dy, BackwardTile<S>* tile, int y, Row<S>* through,
                       RowSums<S>* sums) {
  Row<S> gauss, alpha;
  AlphaRow(splat, dx, dy, *through, &gauss, &alpha);
  const Row<S> weight = alpha * *through, zero = weight - weight;
  Row<S> value = tile->by_alpha[y];  // derivative by the weight
  for (int c = 0; c < 3; ++c) {
    value += tile->by_rgb[y][c] * splat.rgb[c];
    sums->rgb[c] += tile->by_rgb[y][c] * weight;
  }
  tile->rest[y] -= weight * value;
  Row<S> by_alpha = *through * value - tile->rest[y] / (zero + S(1) - alpha);
  by_alpha = (alpha > zero) & (alpha < zero + S(kMostAlpha)) ? by_alpha : zero;
  sums->opacity += by_alpha * gauss;
  const Row<S> power = by_alpha * alpha, power_x = power * dx;
  sums->power += power, sums->power_x += power_x, sums->power_xx += power_x * dx;
  sums->power_y += power * dy, sums->power_xy += power_x * dy, sums->power_yy += power * (dy * dy);
  *through -= weight;
}

template <class S>
MVS_INLINE void ToGradient(const Splat<S>& splat, const RowSums<S>& sums, SplatGradient<S>* out) {
  const S x = SumOf<S>(sums.power_x), y = SumOf<S>(sums.power_y);
  out->x = splat.a * x + splat.b * y, out->y = splat.b * x + splat.c * y;
  out->a = S(-0.5) * SumOf<S>(sums.power_xx), out->b = -SumOf<S>(sums.power_xy), out->c = S(-0.5) * SumOf<S>(sums.power_yy);
  out->opacity = SumOf<S>(sums.opacity);
  for (int c = 0; c < 3; ++c) out->rgb[c] = SumOf<S>(sums.rgb[c]);
}

template <class S>
MVS_INLINE void BackwardOf(BackwardTile<S>* tile, SplatGradient<S>* gradients) {
  Row<S> through[kTilePx];
  for (int y = 0; y < kTilePx; ++y) through[y] = Row<S>{} + S(1);
  for (int64_t k = 0; k < tile->count; ++k) {
    if (k % kLookEvery == kLookEvery - 1 && !IsOpen<S>(through, tile->rows)) break;
    const Splat<S>& splat = tile->splats[tile->list[k]];
    InTile<S> at;
    PlaceInTile(splat, tile->x0, tile->y0, tile->rows, &at);
    RowSums<S> sums;
    for (int y = at.first; y <= at.last; ++y) AddRow(splat, at.dx, S(y) - at.y, tile, y, &through[y], &sums);
    ToGradient(splat, sums, gradients + k);
  }
}

MVS_SIMD void Backward(BackwardTile<float>* tile, SplatGradient<float>* gradients) { BackwardOf(tile, gradients); }
void Backward(BackwardTile<double>* tile, SplatGradient<double>* gradients) { BackwardOf(tile, gradients); }

template <class S>
void LoadTile(const RasterImage<S>& image, const RasterImage<S>& by_image, BackwardTile<S>* tile) {
  const int columns = std::min(kTilePx, image.width - tile->x0);
  for (int y = 0; y < kTilePx; ++y) {
    for (int c = 0; c < 3; ++c) tile->by_rgb[y][c] = Row<S>{};
    tile->by_alpha[y] = tile->rest[y] = Row<S>{};
    if (y >= tile->rows) continue;
    const size_t at = static_cast<size_t>(tile->y0 + y) * image.width + tile->x0;
    for (int l = 0; l < columns; ++l) {
      S rest = 0;
      for (int c = 0; c < 3; ++c) {
        tile->by_rgb[y][c][l] = by_image.Plane(c)[at + l];
        rest += by_image.Plane(c)[at + l] * image.Plane(c)[at + l];
      }
      tile->by_alpha[y][l] = by_image.Plane(3)[at + l];
      tile->rest[y][l] = rest + by_image.Plane(3)[at + l] * image.Plane(3)[at + l];
    }
  }
}

template <class S>
void Add(const SplatGradient<S>& from, SplatGradient<S>* to) {
  to->x += from.x, to->y += from.y, to->a += from.a, to->b += from.b, to->c += from.c, to->opacity += from.opacity;
  for (int c = 0; c < 3; ++c) to->rgb[c] += from.rgb[c];
}

}  // namespace

template <class S>
std::vector<SplatGradient<S>> RasteriseBackward(const std::vector<Splat<S>>& splats, const Tiles& tiles,
                                                const RasterImage<S>& image, const RasterImage<S>& by_image, int num_threads) {
  std::vector<SplatGradient<S>> entries(tiles.splat.size());
  ParallelFor(tiles.down, num_threads, [&](int64_t row) {
    for (int column = 0; column < tiles.across; ++column) {
      const size_t at = static_cast<size_t>(row) * tiles.across + column;
      if (tiles.begin[at] == tiles.begin[at + 1]) continue;
      BackwardTile<S> tile;
      tile.splats = splats.data(), tile.list = tiles.splat.data() + tiles.begin[at];
      tile.count = tiles.begin[at + 1] - tiles.begin[at];
      tile.x0 = column * kTilePx, tile.y0 = static_cast<int>(row) * kTilePx;
      tile.rows = std::min(kTilePx, image.height - tile.y0);
      LoadTile(image, by_image, &tile);
      Backward(&tile, entries.data() + tiles.begin[at]);
    }
  });
  std::vector<SplatGradient<S>> out(splats.size());
  for (size_t i = 0; i < splats.size(); ++i)
    for (int64_t k = tiles.entry_begin[i]; k < tiles.entry_begin[i + 1]; ++k)
      Add(entries[static_cast<size_t>(tiles.entry[static_cast<size_t>(k)])], &out[i]);
  return out;
}

template std::vector<SplatGradient<float>> RasteriseBackward(const std::vector<Splat<float>>&, const Tiles&,
                                                             const RasterImage<float>&, const RasterImage<float>&, int);
template std::vector<SplatGradient<double>> RasteriseBackward(const std::vector<Splat<double>>&, const Tiles&,
                                                              const RasterImage<double>&, const RasterImage<double>&, int);

}  // namespace mvstudio::splats
