#pragma once

#include <ATen/core/Tensor.h>

namespace mvstudio::avatar {

/// Bilinear samples of a texture of any number of channels on the body's charts, (24, C, S, S): at each pixel of the part that
/// `parts` (B, 24, H, W) has as 1, at its coordinates `uv` (B, 2, H, W) in [-1, 1] -> (B, C, H, W), 0 where no part is 1.
/// -1 and 1 are the outer edges of a chart's border texels, which are repeated outwards, as in SampleTextures. Gradients reach
/// the texture.
at::Tensor SampleCharts(const at::Tensor& texture, const at::Tensor& parts, const at::Tensor& uv);

}  // namespace mvstudio::avatar
