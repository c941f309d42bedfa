#pragma once

#include <ATen/core/Tensor.h>

#include <string>

namespace mvstudio::avatar {

/// Batched, differentiable projection for every lens model except the splined one, by its name ("pinhole", "brown5",
/// "ucm_p", …): the formulas of geometry/lens/models/ over tensors. x_in_cam (..., 3) and params (..., P) with P =
/// fx, fy, cx, cy, then the distortion in the model's order; leading sizes broadcast. Returns (..., 2) px; NaN where the
/// formula is undefined (z <= 0; for wide models the negative axis, or a denominator <= 0). Throws UsageError for an
/// unknown model and for "splined": images of such lenses must be undistorted first.
at::Tensor ProjectTensor(const std::string& lens_model, const at::Tensor& params, const at::Tensor& x_in_cam);

/// Pinhole shorthand: x_in_cam (B, J, 3), intrinsics (B, 4) -> (B, J, 2) px.
at::Tensor ProjectPinhole(const at::Tensor& intrinsics, const at::Tensor& x_in_cam);

}  // namespace mvstudio::avatar
