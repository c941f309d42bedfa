#include "avatar/run/pack/pack_rows.h"

#include <ATen/ATen.h>

#include <algorithm>

#include "avatar/maps/template_maps.h"
#include "core/check.h"

namespace mvstudio::avatar {
namespace {

/// Interleaved colours as planes (3, H, W).
void FillPlanes(const Image& rgb, uint8_t* out) {
  const size_t area = rgb.pixels.size() / 3;
  for (size_t p = 0; p < area; ++p) {
    for (size_t k = 0; k < 3; ++k) out[k * area + p] = rgb.pixels[3 * p + k];
  }
}

}  // namespace

AvatarPack EmptyPack(const std::vector<std::string>& cameras, int64_t n, const TrainingSetOptions& options) {
  const int size_px = options.size_px, num_joints = options.num_joints, template_px = options.template_input_px;
  AvatarPack pack;
  pack.size_px = size_px;
  pack.cameras = cameras;
  pack.images = at::zeros({n, 3, size_px, size_px}, at::kByte);
  pack.masks = at::zeros({n, size_px, size_px}, at::kByte);
  pack.joints_in_cam = at::zeros({n, num_joints, 3}, at::kFloat);
  pack.joint_valid = at::zeros({n, num_joints}, at::kBool);
  pack.intrinsics = at::zeros({n, 4}, at::kFloat);
  pack.part = at::zeros({n, size_px, size_px}, at::kByte);
  pack.uv = at::zeros({n, 2, size_px, size_px}, at::kFloat);
  if (template_px > 0) pack.template_maps = at::zeros({n, kTemplateMaps, template_px, template_px}, at::kFloat);
  if (template_px > 0 && options.template_colours)
    pack.template_colours = at::zeros({n, 3, template_px, template_px}, at::kByte);
  if (options.fitted) pack.body_images = at::zeros({n, 4, size_px, size_px}, at::kByte);
  pack.camera_idx = at::zeros({n}, at::kLong);
  pack.frame = at::zeros({n}, at::kLong);
  return pack;
}

void FillImage(AvatarPack& pack, int64_t i, const Image& image, const Image& mask) {
  const int64_t area = static_cast<int64_t>(pack.size_px) * pack.size_px;
  FillPlanes(image, pack.images.data_ptr<uint8_t>() + 3 * area * i);
  std::copy(mask.pixels.begin(), mask.pixels.end(), pack.masks.data_ptr<uint8_t>() + area * i);
}

void FillBodyImage(AvatarPack& pack, int64_t i, const body::RenderedBody& rendered) {
  const int64_t area = static_cast<int64_t>(pack.size_px) * pack.size_px;
  uint8_t* out = pack.body_images.data_ptr<uint8_t>() + 4 * area * i;
  FillPlanes(rendered.image, out);
  std::copy(rendered.cover.pixels.begin(), rendered.cover.pixels.end(), out + 3 * area);
}

void FillLabels(AvatarPack& pack, int64_t i, const body::PartUvMap& map) {
  const int64_t area = static_cast<int64_t>(pack.size_px) * pack.size_px;
  std::copy(map.part.begin(), map.part.end(), pack.part.data_ptr<uint8_t>() + area * i);
  float* uv = pack.uv.data_ptr<float>() + 2 * area * i;
  std::copy(map.u.begin(), map.u.end(), uv);
  std::copy(map.v.begin(), map.v.end(), uv + area);
}

void FillPose(AvatarPack& pack, int64_t i, const FullPose& pose, const geometry::RigCamera& crop) {
  const auto count = static_cast<int64_t>(pose.valid.size());
  MVS_CHECK(pack.joint_valid.size(1) == count, count << " joints for a pack of " << pack.joint_valid.size(1));
  for (int64_t j = 0; j < count; ++j) {
    const Eigen::Vector3d x = crop.cam_from_world * Eigen::Vector3d(pose.x_in_world.col(j));
    const bool valid = pose.valid[static_cast<size_t>(j)] && x.z() > 0;
    pack.joint_valid.data_ptr<bool>()[i * count + j] = valid;
    for (int k = 0; valid && k < 3; ++k)
      pack.joints_in_cam.data_ptr<float>()[(i * count + j) * 3 + k] = static_cast<float>(x[k]);
  }
  for (int k = 0; k < 4; ++k) pack.intrinsics.data_ptr<float>()[4 * i + k] = static_cast<float>(crop.camera.params[k]);
}

void FillPose(AvatarPack& pack, int64_t i, const dataset::Coco19Pose& pose, const geometry::RigCamera& crop) {
  FillPose(pack, i, BodyAlone(pose, static_cast<int>(pack.joint_valid.size(1))), crop);
}

Image ImageOfBytes(const at::Tensor& chw) {
  const at::Tensor hwc = chw.permute({1, 2, 0}).contiguous();
  Image image(static_cast<int>(hwc.size(1)), static_cast<int>(hwc.size(0)), static_cast<int>(hwc.size(2)));
  std::copy_n(hwc.data_ptr<uint8_t>(), image.pixels.size(), image.pixels.begin());
  return image;
}

}  // namespace mvstudio::avatar
