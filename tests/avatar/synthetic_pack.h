#pragma once

#include <ATen/ATen.h>

#include <cmath>

#include "avatar/data/pack.h"
#include "avatar/maps/bones.h"
#include "avatar/maps/camera_tensor.h"
#include "core/random.h"

namespace mvstudio::avatar {

/// Stick people in random poses: each bone is a part of its own colour that changes along the bone, drawn from its joints.
inline AvatarPack MakeSyntheticPack(int64_t count, int size_px, uint64_t seed, double half_width_share = 0.03) {
  const double rest[19][2] = {{0, -.5},   {0, -.65},  {0, 0},      {.2, -.5},   {.3, -.25},  {.35, 0}, {.1, 0},
                              {.12, .4},  {.13, .8},  {-.2, -.5},  {-.3, -.25}, {-.35, 0},   {-.1, 0}, {-.12, .4},
                              {-.13, .8}, {.03, -.7}, {.08, -.68}, {-.03, -.7}, {-.08, -.68}};
  Rng random(seed);
  AvatarPack pack;
  pack.size_px = size_px;
  pack.cameras = {"cam_00", "cam_01"};
  pack.joints_in_cam = at::zeros({count, 19, 3}, at::kFloat);
  for (int64_t i = 0; i < count; ++i) {
    for (int64_t j = 0; j < 19; ++j) {
      for (int64_t c = 0; c < 3; ++c) {
        pack.joints_in_cam[i][j][c] = (c < 2 ? rest[j][c] : 3.0) + (j == 2 ? 0 : random.Uniform(-0.05, 0.05));
      }
    }
  }
  pack.joint_valid = at::ones({count, 19}, at::kBool);
  const double focal = 1.6 * size_px, centre = 0.5 * (size_px - 1);
  pack.intrinsics = at::tensor({focal, focal, centre, centre}, at::kFloat).expand({count, 4}).contiguous();
  pack.part = at::zeros({count, size_px, size_px}, at::kByte);
  pack.uv = at::zeros({count, 2, size_px, size_px}, at::kFloat);
  pack.images = at::zeros({count, 3, size_px, size_px}, at::kByte);
  const at::Tensor px = ProjectPinhole(pack.intrinsics, pack.joints_in_cam).contiguous();
  for (int64_t i = 0; i < count; ++i) {
    for (int64_t k = 0; k < kNumBones; ++k) {
      const float* joints = px.data_ptr<float>() + i * 38;
      const float *a = joints + 2 * kBones[k].first, *b = joints + 2 * kBones[k].second;
      const double dx = b[0] - a[0], dy = b[1] - a[1], length2 = std::max(dx * dx + dy * dy, 1e-6);
      for (int64_t y = 0; y < size_px; ++y) {
        for (int64_t x = 0; x < size_px; ++x) {
          const double t = std::clamp(((x - a[0]) * dx + (y - a[1]) * dy) / length2, 0.0, 1.0);
          const double distance = std::hypot(x - a[0] - t * dx, y - a[1] - t * dy);
          if (distance > half_width_share * size_px) continue;
          pack.part.data_ptr<uint8_t>()[(i * size_px + y) * size_px + x] = static_cast<uint8_t>(k + 1);
          float* uv = pack.uv.data_ptr<float>() + 2 * i * size_px * size_px + y * size_px + x;
          uv[0] = static_cast<float>(t), uv[size_px * size_px] = static_cast<float>(distance / (half_width_share * size_px));
          uint8_t* rgb = pack.images.data_ptr<uint8_t>() + 3 * i * size_px * size_px + y * size_px + x;
          const double colour[3] = {40 + 10.0 * k, 60 + 150 * t, 230 - 11.0 * k};
          for (int64_t c = 0; c < 3; ++c) rgb[c * size_px * size_px] = static_cast<uint8_t>(colour[c]);
        }
      }
    }
  }
  pack.masks = (pack.part > 0).to(at::kByte) * 255;
  pack.camera_idx = at::arange(count, at::kLong) % 2;
  pack.frame = at::arange(count, at::kLong).floor_divide(2);
  return pack;
}

}  // namespace mvstudio::avatar
