#pragma once

#include <vector>

#include "core/image.h"

namespace mvstudio::dataset {

/// A picture and its mask, to be looked at.
struct SheetTile {
  Image rgb;    // (H, W, 3)
  Image mask;   // (H, W, 1)
  Image truth;  // (H, W, 1); empty when there is none
};

/// Tiles in rows of `columns`, each shrunk (or, when small, enlarged) to about `tile_px` on its longer side, cut to the masks
/// with a margin when `crop` is set. The outline is green; with a truth, what is too much is red and what is too little blue.
Image ContactSheet(const std::vector<SheetTile>& tiles, int columns, int tile_px, bool crop);

}  // namespace mvstudio::dataset
