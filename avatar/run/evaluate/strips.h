#pragma once

#include <ATen/core/Tensor.h>

#include "core/image.h"

namespace mvstudio::avatar {

/// truth | render | error | baseline side by side, each (3, H, W) in [0, 1]; images below 192 px are doubled. The error is
/// the mean absolute difference of the channels, from black (0) over red and yellow to white (0.5 and more).
Image MakeStrip(const at::Tensor& truth, const at::Tensor& render, const at::Tensor& baseline);

}  // namespace mvstudio::avatar
