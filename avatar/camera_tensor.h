#pragma once

#include <ATen/core/Tensor.h>

#include <string>

namespace mvstudio::avatar {

/// Batched projection for every lens model of the calibration, by its name ("pinhole", "brown1", "brown2", "brown4", "brown5",
/// "rational8", "kannala4"): the formulas of geometry/camera_model.h over tensors. x_in_cam (..., 3) and params (..., P) with P
/// = fx, fy, cx, cy, then the distortion in OpenCV's order; leading sizes broadcast. Returns (..., 2) px; NaN where the formula
/// is undefined (z <= 0; for kannala4 the negative axis). Differentiable. Throws UsageError for an unknown model.
at::Tensor ProjectTensor(const std::string& lens_model, const at::Tensor& params, const at::Tensor& x_in_cam);

/// Pinhole shorthand: x_in_cam (B, J, 3), intrinsics (B, 4) -> (B, J, 2) px.
at::Tensor ProjectPinhole(const at::Tensor& intrinsics, const at::Tensor& x_in_cam);

}  // namespace mvstudio::avatar
