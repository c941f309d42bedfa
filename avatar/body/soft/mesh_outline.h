#pragma once

#include <vector>

#include "avatar/body/fit/screen_cover.h"

namespace mvstudio::body {

/// A piece of an edge (a, b) of a mesh: from a + first (b - a) to a + last (b - a) in the image.
struct OutlinePiece {
  int a = 0, b = 0;  ///< vertices, a < b
  double first = 0, last = 1;
};

struct MeshOutline {
  std::vector<OutlinePiece> pieces;
  int skipped_faces = 0;  ///< without an area in the image, or with a vertex that is not seen or beyond 1e9 px
};

/// Where the union of a mesh's projected faces ends: edges with all their faces on one side, in pieces of at most a pixel
/// behind whose middle nothing lies. Within `margin_px` of an image of `width_px` x `height_px`.
MeshOutline FindOutline(const Eigen::Matrix3Xi& faces, const ScreenVertices& screen, int width_px, int height_px,
                        double margin_px);

}  // namespace mvstudio::body
