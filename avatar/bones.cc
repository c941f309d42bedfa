#include "avatar/bones.h"

#include <ATen/ATen.h>
#include <ATen/Parallel.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/check.h"

namespace mvstudio::avatar {
namespace {

void CheckInputs(const at::Tensor& joints_px, const at::Tensor& depth, const at::Tensor& valid) {
  const int64_t batch = joints_px.size(0);
  MVS_CHECK(joints_px.sizes() == at::IntArrayRef({batch, 19, 2}), "joints_px must be (B, 19, 2), it is " << joints_px.sizes());
  MVS_CHECK(depth.sizes() == at::IntArrayRef({batch, 19}) && valid.sizes() == depth.sizes() && valid.scalar_type() == at::kBool,
            "depth and valid must be (B, 19), valid bool");
  const at::Tensor good = at::isfinite(joints_px).all(2).logical_and(at::isfinite(depth)).logical_or(valid.logical_not());
  MVS_CHECK(good.all().item<bool>(), "a valid joint is not finite (pose "
                                         << good.all(1).logical_not().nonzero()[0].item<int64_t>()
                                         << " of the batch): behind the camera?");
}

float BoneValue(float depth, const DepthRange& range) {
  const auto share = static_cast<float>((depth - range.near_m) / (range.far_m - range.near_m));
  return kBoneNear + (kBoneFar - kBoneNear) * std::clamp(share, 0.0f, 1.0f);
}

struct Segment {
  float ax, ay, bx, by, depth_a, depth_b;
};

/// Draws one bone into its (H, W) map, touching its bounding box only.
void DrawBone(const Segment& s, int64_t height, int64_t width, float half_width, const DepthRange& range, float* map) {
  const float reach = half_width + 1.0f;
  const auto low = [reach](float a, float b) { return std::floor(std::min(a, b) - reach); };
  const auto high = [reach](float a, float b) { return std::ceil(std::max(a, b) + reach); };
  const auto x0 = static_cast<int64_t>(std::clamp(low(s.ax, s.bx), 0.0f, static_cast<float>(width)));
  const auto x1 = static_cast<int64_t>(std::clamp(high(s.ax, s.bx), -1.0f, static_cast<float>(width - 1)));
  const auto y0 = static_cast<int64_t>(std::clamp(low(s.ay, s.by), 0.0f, static_cast<float>(height)));
  const auto y1 = static_cast<int64_t>(std::clamp(high(s.ay, s.by), -1.0f, static_cast<float>(height - 1)));
  const float dx = s.bx - s.ax, dy = s.by - s.ay;
  const float inverse_length2 = 1.0f / std::max(dx * dx + dy * dy, 1e-12f);
  for (int64_t y = y0; y <= y1; ++y) {
    for (int64_t x = x0; x <= x1; ++x) {
      const float px = static_cast<float>(x) - s.ax, py = static_cast<float>(y) - s.ay;
      const float t = std::clamp((px * dx + py * dy) * inverse_length2, 0.0f, 1.0f);
      const float distance = std::hypot(px - t * dx, py - t * dy);
      const float cover = std::clamp(reach - distance, 0.0f, 1.0f);
      if (cover <= 0) continue;
      const float value = BoneValue(s.depth_a + t * (s.depth_b - s.depth_a), range);
      map[y * width + x] = kBoneBackground + cover * (value - kBoneBackground);
    }
  }
}

}  // namespace

at::Tensor BoneDepth(const at::Tensor& joints_in_cam, const at::Tensor& valid, bool relative) {
  const at::Tensor depth = joints_in_cam.select(2, 2);
  if (!relative) return depth;
  const at::Tensor weight = valid.to(depth.dtype());
  const at::Tensor mean = (depth * weight).sum(1) / weight.sum(1).clamp_min(1);
  const at::Tensor centre = at::where(valid.select(1, 2), depth.select(1, 2), mean);
  return depth - centre.unsqueeze(1);
}

DepthRange ChooseDepthRange(const at::Tensor& depth, const at::Tensor& valid) {
  const at::Tensor values = std::get<0>(depth.masked_select(valid).to(at::kDouble).sort());
  const int64_t count = values.size(0);
  MVS_CHECK(count > 0, "no valid joints");
  const double low = values[(count - 1) / 100].item<double>(), high = values[count - 1 - (count - 1) / 100].item<double>();
  MVS_CHECK(std::isfinite(low) && std::isfinite(high), "a depth is not finite");
  const double margin = std::max(0.1 * (high - low), 0.01);
  return {low - margin, high + margin};
}

double BoneHalfWidth(double at_512_px, int64_t size_px) {
  return std::max(1.0, at_512_px * static_cast<double>(size_px) / 512.0);
}

at::Tensor RasterizeBonesTensor(const at::Tensor& joints_px, const at::Tensor& depth, const at::Tensor& valid, int64_t height,
                                int64_t width, double half_width_px, const DepthRange& range) {
  CheckInputs(joints_px, depth, valid);
  std::vector<int64_t> from, to;
  for (const auto& bone : kBones) from.push_back(bone.first), to.push_back(bone.second);
  const auto options = at::TensorOptions().device(joints_px.device());
  const at::Tensor a = at::tensor(from, options.dtype(at::kLong)), b = at::tensor(to, options.dtype(at::kLong));
  const auto column = [](const at::Tensor& x) { return x.unsqueeze(-1).unsqueeze(-1); };  // (B, 18) -> (B, 18, 1, 1)
  const at::Tensor drawn = valid.index_select(1, a).logical_and(valid.index_select(1, b));
  const at::Tensor start = at::where(drawn.unsqueeze(-1), joints_px.index_select(1, a), at::zeros({}, joints_px.options()));
  const at::Tensor end = at::where(drawn.unsqueeze(-1), joints_px.index_select(1, b), at::zeros({}, joints_px.options()));
  const at::Tensor dx = column((end - start).select(2, 0)), dy = column((end - start).select(2, 1));
  const at::Tensor px = at::arange(width, joints_px.options()).view({1, 1, 1, width}) - column(start.select(2, 0));
  const at::Tensor py = at::arange(height, joints_px.options()).view({1, 1, height, 1}) - column(start.select(2, 1));
  const at::Tensor t = ((px * dx + py * dy) / (dx * dx + dy * dy).clamp_min(1e-12)).clamp(0, 1);
  const at::Tensor distance = at::hypot(px - t * dx, py - t * dy);
  const at::Tensor cover = (half_width_px + 1 - distance).clamp(0, 1) * column(drawn).to(joints_px.dtype());
  const at::Tensor depth_a = column(depth.index_select(1, a)), depth_b = column(depth.index_select(1, b));
  const at::Tensor share = ((depth_a + t * (depth_b - depth_a) - range.near_m) / (range.far_m - range.near_m)).clamp(0, 1);
  const at::Tensor value = kBoneNear + (kBoneFar - kBoneNear) * at::nan_to_num(share);
  return (kBoneBackground + cover * (value - kBoneBackground)).to(at::kFloat);
}

at::Tensor RasterizeSlopes(const at::Tensor& joints_px, const at::Tensor& x_in_cam, const at::Tensor& valid, int64_t height,
                           int64_t width, double half_width_px) {
  // A bone of constant depth 1 in the range (0, 1) is drawn as its coverage, from -1 to 1.
  const at::Tensor ones = at::ones_like(joints_px.select(2, 0));
  const at::Tensor cover = 0.5 * (RasterizeBones(joints_px, ones, valid, height, width, half_width_px, {0, 1}) + 1);
  std::vector<at::Tensor> slopes;
  for (const auto& [a, b] : kBones) {
    const at::Tensor bone = x_in_cam.select(1, b) - x_in_cam.select(1, a);  // (B, 3)
    slopes.push_back(bone.select(1, 2) / bone.norm(2, 1).clamp_min(1e-6));
  }
  return cover * at::nan_to_num(at::stack(slopes, 1)).unsqueeze(-1).unsqueeze(-1);
}

at::Tensor RasterizeBones(const at::Tensor& joints_px, const at::Tensor& depth, const at::Tensor& valid, int64_t height,
                          int64_t width, double half_width_px, const DepthRange& range) {
  CheckInputs(joints_px, depth, valid);
  const int64_t batch = joints_px.size(0);
  const at::Tensor px = joints_px.to(at::kCPU, at::kFloat).contiguous(), z = depth.to(at::kCPU, at::kFloat).contiguous();
  const at::Tensor ok = valid.to(at::kCPU).contiguous();
  at::Tensor maps = at::full({batch, kNumBones, height, width}, kBoneBackground, at::kFloat);
  const float* px_data = px.data_ptr<float>();
  const float* z_data = z.data_ptr<float>();
  const bool* ok_data = ok.data_ptr<bool>();
  float* out = maps.data_ptr<float>();
  at::parallel_for(0, batch * kNumBones, 1, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) {
      const auto [a, b] = kBones[i % kNumBones];
      const int64_t row = i / kNumBones * 19;
      if (!ok_data[row + a] || !ok_data[row + b]) continue;
      const float *pa = px_data + (row + a) * 2, *pb = px_data + (row + b) * 2;
      DrawBone({pa[0], pa[1], pb[0], pb[1], z_data[row + a], z_data[row + b]}, height, width, static_cast<float>(half_width_px),
               range, out + i * height * width);
    }
  });
  return maps.to(joints_px.device());
}

}  // namespace mvstudio::avatar
