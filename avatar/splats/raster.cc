#include "avatar/splats/raster.h"

#include "avatar/splats/lanes.h"
#include "core/parallel.h"

namespace mvstudio::splats {
namespace {

/// One tile.
template <class S>
struct TileJob {
  const Splat<S>* splats;
  const int* list;  // front to back
  int64_t count;
  int x0, y0, rows, columns;
};

template <class S>
struct TileSums {
  Row<S> rgb[kTilePx][3], through[kTilePx];
};

template <class S>
MVS_INLINE void BlendTile(const TileJob<S>& job, TileSums<S>* sums) {
  for (int y = 0; y < kTilePx; ++y) {
    for (int c = 0; c < 3; ++c) sums->rgb[y][c] = Row<S>{};
    sums->through[y] = Row<S>{} + S(1);
  }
  for (int64_t k = 0; k < job.count; ++k) {
    if (k % kLookEvery == kLookEvery - 1 && !IsOpen<S>(sums->through, job.rows)) break;
    const Splat<S>& splat = job.splats[job.list[k]];
    InTile<S> at;
    PlaceInTile(splat, job.x0, job.y0, job.rows, &at);
    for (int y = at.first; y <= at.last; ++y) {
      Row<S> gauss, alpha;
      AlphaRow(splat, at.dx, S(y) - at.y, sums->through[y], &gauss, &alpha);
      const Row<S> weight = alpha * sums->through[y];
      for (int c = 0; c < 3; ++c) sums->rgb[y][c] += weight * splat.rgb[c];
      sums->through[y] -= weight;
    }
  }
}

MVS_SIMD void Blend(const TileJob<float>& job, TileSums<float>* sums) { BlendTile(job, sums); }
void Blend(const TileJob<double>& job, TileSums<double>* sums) { BlendTile(job, sums); }

template <class S>
void Store(const TileJob<S>& job, const TileSums<S>& sums, RasterImage<S>* image) {
  for (int y = 0; y < job.rows; ++y) {
    const size_t at = static_cast<size_t>(job.y0 + y) * image->width + job.x0;
    for (int l = 0; l < job.columns; ++l) {
      for (int c = 0; c < 3; ++c) image->Plane(c)[at + l] = sums.rgb[y][c][l];
      image->Plane(3)[at + l] = 1 - sums.through[y][l];
    }
  }
}

}  // namespace

template <class S>
RasterImage<S> Rasterise(const std::vector<Splat<S>>& splats, const Tiles& tiles, int width, int height, int num_threads) {
  RasterImage<S> image;
  image.width = width, image.height = height;
  image.values.assign(4 * image.area(), S(0));
  ParallelFor(tiles.down, num_threads, [&](int64_t row) {
    for (int column = 0; column < tiles.across; ++column) {
      const size_t tile = static_cast<size_t>(row) * tiles.across + column;
      if (tiles.begin[tile] == tiles.begin[tile + 1]) continue;
      const int x0 = column * kTilePx, y0 = static_cast<int>(row) * kTilePx;
      const TileJob<S> job{splats.data(),
                           tiles.splat.data() + tiles.begin[tile],
                           tiles.begin[tile + 1] - tiles.begin[tile],
                           x0,
                           y0,
                           std::min(kTilePx, height - y0),
                           std::min(kTilePx, width - x0)};
      TileSums<S> sums;
      Blend(job, &sums);
      Store(job, sums, &image);
    }
  });
  return image;
}

template RasterImage<float> Rasterise(const std::vector<Splat<float>>&, const Tiles&, int, int, int);
template RasterImage<double> Rasterise(const std::vector<Splat<double>>&, const Tiles&, int, int, int);

}  // namespace mvstudio::splats
