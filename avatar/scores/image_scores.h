#pragma once

#include <ATen/core/Tensor.h>

#include <vector>

#include "avatar/metrics/scores.h"

/// Converts between tensors and metrics/.
namespace mvstudio::avatar {

/// A float image in [0, 1], rounded as in an 8-bit file: float64 multiples of 1/255.
at::Tensor EightBit(const at::Tensor& images);

/// (C, H, W) in [0, 1].
metrics::PlanarImage ToPlanarImage(const at::Tensor& image);
/// (H, W): nonzero where `mask` is at least 0.5.
metrics::Mask ToMask(const at::Tensor& mask);

/// truth, image: (N, 3, H, W) in [0, 1], on black; true_mask (N, H, W) nonzero inside; mask (N, H, W) in [0, 1].
std::vector<metrics::ImageScore> ScoreImages(const at::Tensor& truth, const at::Tensor& true_mask, const at::Tensor& image,
                                             const at::Tensor& mask);

}  // namespace mvstudio::avatar
