#pragma once

#include <ATen/core/Tensor.h>

#include <vector>

#include "avatar/maps/bone_lists.h"

namespace mvstudio::avatar {

/// Depths that map to the two ends of a bone's value. Values outside saturate.
struct DepthRange {
  double near_m = 0;
  double far_m = 1;
};

/// Values of drawn bones; the background is strictly below the nearest depth.
inline constexpr float kBoneNear = -0.8f, kBoneFar = 1.0f, kBoneBackground = -1.0f;

/// Depth shown by a bone: distance along the optical axis, or that minus the depth of the body's centre (joint 2; BODY_25:
/// joint 8; the mean of the body's valid joints where it is missing). joints_in_cam (B, J, 3), valid (B, J) -> (B, J)
/// metres, J as in bone_lists.h.
at::Tensor BoneDepth(const at::Tensor& joints_in_cam, const at::Tensor& valid, bool relative);

/// 1st and 99th percentile of the depth of the body's valid joints, widened by 10 % of their distance (at least 1 cm). depth,
/// valid (B, J).
DepthRange ChooseDepthRange(const at::Tensor& depth, const at::Tensor& valid);

/// Draws each line of a map as a capsule with a 1 px linear ramp outside, thin maps half as wide; the depth is
/// interpolated linearly along the line. Where lines of one map overlap, the larger value is kept. A line with an invalid
/// joint is omitted, and so are lines to joints beyond the list (no hands, no face). Joints may be outside the image.
///
/// joints_px (B, J, 2), depth (B, J) metres, valid (B, J) bool -> (B, number of maps, H, W) float32. Throws
/// ContractViolation for valid joints that are not finite.
///
/// Two implementations of one definition: whole-tensor operations for any device, and loops over each line's bounding box.
at::Tensor RasterizeMapsTensor(const std::vector<InputMap>& maps, const at::Tensor& joints_px, const at::Tensor& depth,
                               const at::Tensor& valid, int64_t height, int64_t width, double half_width_px,
                               const DepthRange& range);
at::Tensor RasterizeMaps(const std::vector<InputMap>& maps, const at::Tensor& joints_px, const at::Tensor& depth,
                         const at::Tensor& valid, int64_t height, int64_t width, double half_width_px, const DepthRange& range);

/// The same for Panoptic's 18 bones.
at::Tensor RasterizeBones(const at::Tensor& joints_px, const at::Tensor& depth, const at::Tensor& valid, int64_t height,
                          int64_t width, double half_width_px, const DepthRange& range);

/// Second set of channels: the same capsules, with the fraction of the bone that points away from the camera, (z_b - z_a)
/// / length, in [-1, 1]; background 0. Shows the direction the body faces where depths differ little. x_in_cam (B, 19, 3)
/// -> (B, 18, H, W).
at::Tensor RasterizeSlopes(const at::Tensor& joints_px, const at::Tensor& x_in_cam, const at::Tensor& valid, int64_t height,
                           int64_t width, double half_width_px);

/// Half-width of a bone in an image of `size_px`: `at_512_px` scaled, at least 1 px.
double BoneHalfWidth(double at_512_px, int64_t size_px);

}  // namespace mvstudio::avatar
