#pragma once

#include <ATen/core/Tensor.h>

#include "avatar/bone_lists.h"

namespace mvstudio::avatar {

/// Depths that map to the two ends of a bone's value. Nearer and farther ones saturate.
struct DepthRange {
  double near_m = 0;
  double far_m = 1;
};

/// Values of drawn bones; the background is strictly below the nearest depth.
inline constexpr float kBoneNear = -0.8f, kBoneFar = 1.0f, kBoneBackground = -1.0f;

/// Which depth a bone shows: distance along the optical axis, or that minus the depth of the body's centre (joint 2; the mean
/// of the valid joints where that one is missing). joints_in_cam (B, 19, 3), valid (B, 19) -> (B, 19) metres.
at::Tensor BoneDepth(const at::Tensor& joints_in_cam, const at::Tensor& valid, bool relative);

/// 1st and 99th percentile of the valid joints' depth, widened by 10 % of their distance (at least 1 cm). depth, valid (B, 19).
DepthRange ChooseDepthRange(const at::Tensor& depth, const at::Tensor& valid);

/// Draws each bone as a capsule with a 1 px linear ramp outside; the depth is interpolated linearly along the bone. A bone with
/// an invalid joint is background; joints outside the image do not matter. joints_px (B, 19, 2), depth (B, 19) metres, valid
/// (B, 19) bool
/// -> (B, 18, H, W) float32. Throws ContractViolation for valid joints that are not finite.
/// Two implementations of one definition: whole-tensor operations for any device, and loops over each bone's bounding box.
at::Tensor RasterizeBonesTensor(const at::Tensor& joints_px, const at::Tensor& depth, const at::Tensor& valid, int64_t height,
                                int64_t width, double half_width_px, const DepthRange& range);
at::Tensor RasterizeBones(const at::Tensor& joints_px, const at::Tensor& depth, const at::Tensor& valid, int64_t height,
                          int64_t width, double half_width_px, const DepthRange& range);

/// Second set of channels: the same capsules, with the share of the bone that points away from the camera, (z_b - z_a) /
/// length, in
/// [-1, 1]; background 0. Shows which way the body faces, where depths differ little. x_in_cam (B, 19, 3) -> (B, 18, H, W).
at::Tensor RasterizeSlopes(const at::Tensor& joints_px, const at::Tensor& x_in_cam, const at::Tensor& valid, int64_t height,
                           int64_t width, double half_width_px);

/// Half-width of a bone in a picture of `size_px`: `at_512_px` scaled, at least 1 px.
double BoneHalfWidth(double at_512_px, int64_t size_px);

}  // namespace mvstudio::avatar
