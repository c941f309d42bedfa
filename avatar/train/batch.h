#pragma once

#include <ATen/core/Tensor.h>

#include <vector>

#include "avatar/data/pack.h"
#include "avatar/nets/model.h"
#include "avatar/settings/options.h"

namespace mvstudio::avatar {

/// Input of one training step.
struct TrainBatch {
  std::vector<int64_t> images;  ///< rows of the pack
  at::Tensor maps;              ///< (B, C, H, W) network input
  at::Tensor image;             ///< (B, 3, H, W) float32 in [0, 1], black outside the mask
  at::Tensor mask;              ///< (B, H, W) float32 in [0, 1]
  at::Tensor part;              ///< (B, H, W) int64, 0..24
  at::Tensor uv;                ///< (B, 2, H, W) float32 in [-1, 1]
};

/// Rows of the pack for a step: a fresh permutation each epoch; a function of (seed, step) alone.
std::vector<int64_t> ImagesOfStep(int64_t num_images, int64_t batch, uint64_t seed, int64_t step);

/// Gathers images. When `jitter` is set, each is scaled, rotated and shifted at random (a function of (seed, step)),
/// keypoints and images alike; depths are unchanged. `first`: number of images of the step before these, in other
/// processes.
TrainBatch MakeBatch(const AvatarPack& pack, const AvatarModel& model, const TrainOptions& options,
                     const std::vector<int64_t>& images, bool jitter, uint64_t seed, int64_t step, int64_t first = 0);

/// Adapts labels to the masks: template pixels outside the mask become background; pixels of the person that the template
/// misses get the label and coordinates of the nearest labelled pixel. Changes part and uv of the pack.
void FitLabelsToMasks(AvatarPack& pack, int num_threads);

}  // namespace mvstudio::avatar
