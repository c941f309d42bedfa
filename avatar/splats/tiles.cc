#include "avatar/splats/tiles.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace mvstudio::splats {
namespace {

/// Tiles x0 <= x < x1, y0 <= y < y1.
struct TileBox {
  int x0, y0, x1, y1;
};

/// First and last tile that an interval of pixels touches, inside the image.
template <class S>
void Span(S middle, S reach, int pixels, int* first, int* last) {
  const S low = std::max(middle - reach, S(0)), high = std::min(middle + reach, S(pixels - 1));
  *first = static_cast<int>(std::ceil(low)) / kTilePx;
  *last = static_cast<int>(std::floor(high)) / kTilePx + 1;
}

template <class S>
TileBox BoxOf(const Splat<S>& splat, int width, int height) {
  TileBox box;
  Span(splat.x, splat.reach_x, width, &box.x0, &box.x1);
  Span(splat.y, splat.reach_y, height, &box.y0, &box.y1);
  return box;
}

template <class S>
std::vector<int> FrontToBack(const std::vector<Splat<S>>& splats) {
  std::vector<std::pair<S, int>> keys(splats.size());
  for (size_t i = 0; i < keys.size(); ++i) keys[i] = {splats[i].depth, static_cast<int>(i)};
  std::sort(keys.begin(), keys.end());
  std::vector<int> order(keys.size());
  for (size_t i = 0; i < keys.size(); ++i) order[i] = keys[i].second;
  return order;
}

}  // namespace

template <class S>
Tiles BinSplats(const std::vector<Splat<S>>& splats, int width, int height) {
  Tiles tiles;
  tiles.across = (width + kTilePx - 1) / kTilePx, tiles.down = (height + kTilePx - 1) / kTilePx;
  tiles.begin.assign(static_cast<size_t>(tiles.across) * tiles.down + 1, 0);
  tiles.entry_begin.assign(splats.size() + 1, 0);
  std::vector<TileBox> boxes(splats.size());
  for (size_t i = 0; i < splats.size(); ++i) {
    boxes[i] = BoxOf(splats[i], width, height);
    for (int y = boxes[i].y0; y < boxes[i].y1; ++y)
      for (int x = boxes[i].x0; x < boxes[i].x1; ++x) ++tiles.begin[static_cast<size_t>(y) * tiles.across + x + 1];
    const int64_t area = int64_t{std::max(0, boxes[i].x1 - boxes[i].x0)} * std::max(0, boxes[i].y1 - boxes[i].y0);
    tiles.entry_begin[i + 1] = tiles.entry_begin[i] + area;
  }
  std::partial_sum(tiles.begin.begin(), tiles.begin.end(), tiles.begin.begin());
  tiles.splat.resize(static_cast<size_t>(tiles.begin.back()));
  tiles.entry.resize(tiles.splat.size());
  std::vector<int64_t> next(tiles.begin.begin(), tiles.begin.end() - 1);
  for (const int i : FrontToBack(splats)) {
    int64_t* entry = tiles.entry.data() + tiles.entry_begin[static_cast<size_t>(i)];
    const TileBox& box = boxes[static_cast<size_t>(i)];
    for (int y = box.y0; y < box.y1; ++y) {
      for (int x = box.x0; x < box.x1; ++x) {
        const int64_t at = next[static_cast<size_t>(y) * tiles.across + x]++;
        tiles.splat[static_cast<size_t>(at)] = i;
        *entry++ = at;
      }
    }
  }
  return tiles;
}

template Tiles BinSplats(const std::vector<Splat<float>>&, int, int);
template Tiles BinSplats(const std::vector<Splat<double>>&, int, int);

}  // namespace mvstudio::splats
