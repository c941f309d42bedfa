#pragma once

#include <ATen/core/Tensor.h>

#include <cstdint>

namespace mvstudio::avatar {

/// Samples all 24 textures and blends them. part_prob (B, 25, H, W) with channel 0 the background, uv (B, 48, H, W) in
/// [-1, 1] (24 u, then 24 v), textures (24, 3, S, S) in [-1, 1], background (3) in [0, 1] -> (B, 3, H, W), in [0, 1] where
/// textures are in range. Bilinear; border texels are repeated outwards; -1 and 1 are the outer edges of the border
/// texels. One grid_sample call. Throws ContractViolation when a coordinate is not finite (grid_sample would return
/// plausible colours).
at::Tensor SampleTextures(const at::Tensor& textures, const at::Tensor& part_prob, const at::Tensor& uv,
                          const at::Tensor& background);

/// Running mean of the colours assigned to each texel, spread with bilinear weights.
struct TextureSums {
  at::Tensor colour;  // (24, S, S, 3) float32, sum of weight * colour
  at::Tensor weight;  // (24, S, S) float32
};
TextureSums ZeroTextureSums(int64_t size_px);
/// Adds pixels: part (P) int64 in 1..24, uv (P, 2) in [-1, 1], rgb (P, 3) in [-1, 1], weight (P).
void AddPixels(TextureSums& sums, const at::Tensor& part, const at::Tensor& uv, const at::Tensor& rgb,
               const at::Tensor& weight);
/// Means where the weight is above `min_weight`. Texels farther than an eighth of the chart from any seen texel take most
/// of their colour from seen texels of the same row. These are in their own chart and in similar ones (both sides of the
/// trunk, all thighs). The rest comes from the nearest coarser level that has colours (pull-push). A part without any
/// colour in it and in similar ones gets the mean of all parts.
at::Tensor FillTextures(const TextureSums& sums, double min_weight = 0.05);

}  // namespace mvstudio::avatar
