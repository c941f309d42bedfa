#pragma once

#include "core/image.h"
#include "stages/overlay/options.h"
#include "stages/view/scene.h"
#include "stages/view/solids.h"

namespace mvstudio::stages {

/// The image of a view, reduced to a longer side of at most `tile_px` (0: not), with what is known of it drawn over it in lines
/// of the same width at any size; boards and the body below the joints. `frame`: of the footage, or empty: black, as large as
/// the lens says. `mask` may be empty, or of another size: then it is left out.
Image DrawnView(const Scene& scene, size_t camera_idx, const SceneView& view, const Image& frame, const Image& mask,
                int tile_px, const OverlayMarks& marks, const SolidsNow& solids = {});

/// The tile and, right of it, a render on as large a ground: reduced where it is larger, black where there is none.
Image WithRender(const Image& tile, const Image& render);

/// All images in rows of about as many columns, both sides even; (H, W, 3).
Image GridOf(const std::vector<Image>& images);

}  // namespace mvstudio::stages
