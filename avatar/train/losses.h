#pragma once

#include <ATen/core/Tensor.h>

namespace mvstudio::avatar {

/// `total` divides the weighted sum over pixels; undefined: the weights of this batch. Several processes divide by the
/// mean of their totals, so that the mean of their losses is the loss of their joint batch.

/// Mean |a - b| over pixels, those of `mask` (B, H, W, 0..1) counted `foreground_weight` times. a, b (B, 3, H, W).
at::Tensor WeightedL1(const at::Tensor& a, const at::Tensor& b, const at::Tensor& mask, double foreground_weight,
                      const at::Tensor& total = {});

/// Mean of 1 - SSIM with a 7x7 box window, values in [0, 1], without zero padding; same weights as above. Wang et al.,
/// 2004.
at::Tensor SsimLoss(const at::Tensor& a, const at::Tensor& b, const at::Tensor& mask, double foreground_weight,
                    const at::Tensor& total = {});

/// Weights of pixels that sum to one, (B, 1, H, W): those of `mask` (B, H, W, 0..1) `foreground_weight` times the others'.
at::Tensor PixelWeights(const at::Tensor& mask, double foreground_weight, const at::Tensor& total = {});

/// Mean |grad a - grad b| at full, half and quarter size, of the x and the y component added. `weights` as from PixelWeights.
at::Tensor GradientLoss(const at::Tensor& a, const at::Tensor& b, const at::Tensor& weights);

/// Silhouette: negative log-likelihood of the mask. From part logits (B, 25, H, W) by log-softmax, or from a single
/// foreground logit (B, 1, H, W) by log-sigmoid, so the gradient does not vanish at large logits.
at::Tensor MaskLoss(const at::Tensor& logits, const at::Tensor& mask);

/// Cross-entropy of part logits (B, 25, H, W) against labels (B, H, W) int64 in 0..24; person and background have equal
/// total weight, however small the person is.
at::Tensor PartLoss(const at::Tensor& logits, const at::Tensor& part, const at::Tensor& person_total = {},
                    const at::Tensor& rest_total = {});

/// Mean |difference| of the labelled part's coordinates over labelled pixels. uv (B, 48, H, W) and target (B, 2, H, W) in [-1,
/// 1].
at::Tensor UvLoss(const at::Tensor& uv, const at::Tensor& target, const at::Tensor& part, const at::Tensor& total = {});

/// Total pixel weight of a batch, the divisor of WeightedL1 (and, within SSIM's windows, of SsimLoss).
at::Tensor PixelTotal(const at::Tensor& mask, double foreground_weight);
at::Tensor SsimPixelTotal(const at::Tensor& mask, double foreground_weight);

/// Mean of relu(|x| - limit)^2.
at::Tensor SaturationLoss(const at::Tensor& x, double limit);

}  // namespace mvstudio::avatar
