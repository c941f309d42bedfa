#pragma once

#include <vector>

#include "core/image.h"

namespace mvstudio::dataset {

/// An image and its mask, for visual inspection.
struct SheetTile {
  Image rgb;    // (H, W, 3)
  Image mask;   // (H, W, 1)
  Image truth;  // (H, W, 1); empty when there is none
};

/// Tiles in rows of `columns`, each scaled to about `tile_px` on its longer side, and cropped to the masks with a margin
/// when `crop` is set. The outline is green; with a truth, excess is red and missing parts are blue.
Image ContactSheet(const std::vector<SheetTile>& tiles, int columns, int tile_px, bool crop);

}  // namespace mvstudio::dataset
