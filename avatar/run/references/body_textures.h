#pragma once

#include <ATen/core/Tensor.h>

#include "avatar/body/texture/bake.h"

namespace mvstudio::avatar {

/// A body's colours (24, 3, S, S) float32 in [-1, 1], as networks hold textures.
at::Tensor TexturesToTensor(const body::Textures& textures);

}  // namespace mvstudio::avatar
