// Private: rows of a pack, for training_set.cc and its like.
#pragma once

#include <string>
#include <vector>

#include "avatar/body/mesh_raster.h"
#include "avatar/body/texture/bake.h"
#include "avatar/run/pack/training_set.h"
#include "core/image.h"

namespace mvstudio::avatar {

/// `n` rows of zeros, with what `options` ask for.
AvatarPack EmptyPack(const std::vector<std::string>& cameras, int64_t n, const TrainingSetOptions& options);
/// Image (H, W, 3) and mask (H, W) of row i.
void FillImage(AvatarPack& pack, int64_t i, const Image& image, const Image& mask);
void FillBodyImage(AvatarPack& pack, int64_t i, const body::RenderedBody& rendered);
/// Part and coordinates of row i.
void FillLabels(AvatarPack& pack, int64_t i, const body::PartUvMap& map);
/// (channels, H, W) uint8 -> image.
Image ImageOfBytes(const at::Tensor& chw);

}  // namespace mvstudio::avatar
