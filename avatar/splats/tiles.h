#pragma once

#include <cstdint>
#include <vector>

#include "avatar/splats/project.h"

namespace mvstudio::splats {

inline constexpr int kTilePx = 8;  ///< edge of a tile: a row is one vector of the processor

/// Which splats each tile of an image shows.
struct Tiles {
  int across = 0, down = 0;
  std::vector<int64_t> begin;  ///< (tiles + 1) where the tile's entries begin
  std::vector<int> splat;      ///< index into Projected::splats, front to back; equal depths in the order of the cloud
  /// The entries of each splat: (splats + 1) where its list in `entry` begins, and the lists, tiles ascending.
  std::vector<int64_t> entry_begin, entry;
};

/// Sorts by depth and puts each splat into the tiles that its box touches.
template <class S>
Tiles BinSplats(const std::vector<Splat<S>>& splats, int width, int height);

extern template Tiles BinSplats(const std::vector<Splat<float>>&, int, int);
extern template Tiles BinSplats(const std::vector<Splat<double>>&, int, int);

}  // namespace mvstudio::splats
