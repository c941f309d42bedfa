#pragma once

#include <ATen/core/Tensor.h>

#include <cstdint>
#include <string>
#include <vector>

#include "core/charts/body_charts.h"

namespace mvstudio::avatar {

inline constexpr int64_t kNumJoints = 19;  ///< CMU Panoptic's joints
inline constexpr int64_t kNumBodyParts = kNumBodyCharts;

/// The training set of an avatar as dense tensors on the CPU: N square images of one person, undistorted (pinhole),
/// cropped around the person. Row i of every tensor belongs to image i.
struct AvatarPack {
  int size_px = 0;           ///< H = W
  at::Tensor images;         ///< (N, 3, H, W) uint8, RGB
  at::Tensor masks;          ///< (N, H, W) uint8, 0 or 255: the person
  at::Tensor joints_in_cam;  ///< (N, J, 3) float32, metres, in cam; anything finite where joint_valid is false
  at::Tensor joint_valid;    ///< (N, J) bool; J = 19, 25, 131 or 137, see bone_lists.h
  at::Tensor intrinsics;     ///< (N, 4) float32: fx, fy, cx, cy px of the crop; (0, 0) is the centre of the top-left pixel
  at::Tensor part;           ///< (N, H, W) uint8, 0 background, 1..24: initial value from the posed template
  at::Tensor uv;             ///< (N, 2, H, W) float32 in [0, 1], initial value, 0 on background
  /// (N, 4, P, P) float32, for networks with the template as their prior (template_maps.h), P their image size; undefined:
  /// none
  at::Tensor template_maps;
  /// (N, 3, P, P) uint8: colours of the fitted body beside template_maps, beyond its outline those of the nearest pixel; for
  /// networks that correct them; undefined: none
  at::Tensor template_colours;
  /// (N, 4, H, W) uint8: the fitted body in its averaged colours, posed by the joints: RGB on black, coverage; undefined: none
  at::Tensor body_images;
  /// (N, 4, P, P) uint8: training images of other time steps warped onto the body beside template_maps, RGB on black, and
  /// where there is any (avatar/run/references); for networks that see them; undefined: none
  at::Tensor references;
  at::Tensor camera_idx;             ///< (N) int64, index into cameras
  at::Tensor frame;                  ///< (N) int64, frame number of the dataset
  std::vector<std::string> cameras;  ///< names
  int64_t frame_step = 0;            ///< difference of the numbers of consecutive frames; 0: the rows' usual one
  std::vector<int64_t> cuts;         ///< frames at which another clip begins, ascending: none before is their past

  int64_t size() const { return images.defined() ? images.size(0) : 0; }
};

/// The posed body as a network's input.
struct TemplateView {
  at::Tensor maps;          ///< (B, 4, H, W) float32, as in AvatarPack; undefined for networks without the template
  at::Tensor colours;       ///< (B, 3, H, W) float32 in [0, 1]; undefined for networks that do not correct them
  at::Tensor references{};  ///< (B, 4, H, W) float32 in [0, 1]; undefined for networks that see none
};

/// Network input for B images.
struct PoseBatch {
  at::Tensor joints_in_cam;  ///< (B, J, 3), as in AvatarPack
  at::Tensor joint_valid;    ///< (B, J) bool
  at::Tensor intrinsics;     ///< (B, 4)
  TemplateView body;
};

/// The poses of all images of a pack, or of some rows.
PoseBatch PosesOf(const AvatarPack& pack);
PoseBatch PosesOf(const AvatarPack& pack, const at::Tensor& rows);

/// "camera 00_03, frame 17" of image i, for messages.
std::string ImageName(const AvatarPack& pack, int64_t i);

/// Throws ContractViolation for wrong shapes, types, sizes or indices, and for values that are not finite or out of range.
/// Messages about values name the camera and the frame.
void Validate(const AvatarPack& pack);

/// The images at `indices`, in that order; keeps the list of cameras.
AvatarPack Select(const AvatarPack& pack, const std::vector<int64_t>& indices);

/// One safetensors file. LoadPack validates; throws IoError / FormatError.
void SavePack(const AvatarPack& pack, const std::string& path);
AvatarPack LoadPack(const std::string& path);

}  // namespace mvstudio::avatar
