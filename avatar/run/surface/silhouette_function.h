#pragma once

// Private: has torch's autograd in it.

#include <torch/torch.h>

#include "avatar/body/dynamic/take_outlines.h"
#include "avatar/body/soft/soft_silhouette.h"

namespace mvstudio::avatar {

/// Views of one time step that a loss is of.
struct SilhouetteViews {
  const body::TakeOutlines* take = nullptr;
  const body::PosedStep* step = nullptr;
  std::vector<int> views;
  body::SoftCoverOptions options;
};

/// Mean over the views of body::SilhouetteLoss over the mask's share of the image, of the body with `offsets` (V, 3) at rest,
/// posed as it was seen. A scalar in double precision, with its gradient.
at::Tensor SilhouetteOfOffsets(const at::Tensor& offsets, const SilhouetteViews& views);

}  // namespace mvstudio::avatar
