#include "avatar/maps/bones.h"

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
  MVS_CHECK(joints_px.dim() == 3 && IsJointList(joints_px.size(1)) && joints_px.size(2) == 2,
            "joints_px must be (B, J, 2) with J = 19, 25, 131 or 137, it is " << joints_px.sizes());
  MVS_CHECK(depth.sizes() == at::IntArrayRef({batch, joints_px.size(1)}) && valid.sizes() == depth.sizes() &&
                valid.scalar_type() == at::kBool,
            "depth and valid must be (B, J) like joints_px, valid bool");
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

/// Draws one line into its (H, W) map, touching its bounding box only.
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
      float& pixel = map[y * width + x];
      pixel = std::max(pixel, kBoneBackground + cover * (value - kBoneBackground));
    }
  }
}

bool InList(const BoneLine& line, int64_t num_joints) {
  return std::all_of(line.needs.begin(), line.needs.end(), [&](int j) { return j < num_joints; });
}

/// (B, H, W): all lines of one map.
at::Tensor MapTensor(const InputMap& map, const at::Tensor& joints_px, const at::Tensor& depth, const at::Tensor& valid,
                     int64_t height, int64_t width, double half_width_px, const DepthRange& range) {
  at::Tensor out = at::full({joints_px.size(0), height, width}, kBoneBackground, joints_px.options().dtype(at::kFloat));
  const auto column = [](const at::Tensor& x) { return x.unsqueeze(-1).unsqueeze(-1); };  // (B) -> (B, 1, 1)
  for (const BoneLine& line : map.lines) {
    if (!InList(line, joints_px.size(1))) continue;
    at::Tensor drawn = valid.select(1, line.a);
    for (const int j : line.needs) drawn = drawn.logical_and(valid.select(1, j));
    const auto joint = [&](int j) {
      return at::where(drawn.unsqueeze(-1), joints_px.select(1, j), at::zeros({}, joints_px.options()));
    };
    const at::Tensor start = joint(line.a), end = joint(line.b);
    const at::Tensor dx = column((end - start).select(1, 0)), dy = column((end - start).select(1, 1));
    const at::Tensor px = at::arange(width, joints_px.options()).view({1, 1, width}) - column(start.select(1, 0));
    const at::Tensor py = at::arange(height, joints_px.options()).view({1, height, 1}) - column(start.select(1, 1));
    const at::Tensor t = ((px * dx + py * dy) / (dx * dx + dy * dy).clamp_min(1e-12)).clamp(0, 1);
    const at::Tensor distance = at::hypot(px - t * dx, py - t * dy);
    const at::Tensor cover = (half_width_px + 1 - distance).clamp(0, 1) * column(drawn).to(joints_px.dtype());
    const at::Tensor depth_a = column(depth.select(1, line.a)), depth_b = column(depth.select(1, line.b));
    const at::Tensor share = ((depth_a + t * (depth_b - depth_a) - range.near_m) / (range.far_m - range.near_m)).clamp(0, 1);
    const at::Tensor value = kBoneNear + (kBoneFar - kBoneNear) * at::nan_to_num(share);
    out = at::maximum(out, (kBoneBackground + cover * (value - kBoneBackground)).to(at::kFloat));
  }
  return out;
}

}  // namespace

at::Tensor BoneDepth(const at::Tensor& joints_in_cam, const at::Tensor& valid, bool relative) {
  const at::Tensor depth = joints_in_cam.select(2, 2);
  if (!relative) return depth;
  const int body = NumBodyJoints(depth.size(1)), center = CenterJoint(depth.size(1));
  const at::Tensor weight = valid.slice(1, 0, body).to(depth.dtype());
  const at::Tensor mean = (depth.slice(1, 0, body) * weight).sum(1) / weight.sum(1).clamp_min(1);
  const at::Tensor centre = at::where(valid.select(1, center), depth.select(1, center), mean);
  return depth - centre.unsqueeze(1);
}

DepthRange ChooseDepthRange(const at::Tensor& depth, const at::Tensor& valid) {
  const int body = NumBodyJoints(depth.size(1));
  const at::Tensor values = std::get<0>(depth.slice(1, 0, body).masked_select(valid.slice(1, 0, body)).to(at::kDouble).sort());
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

at::Tensor RasterizeMapsTensor(const std::vector<InputMap>& maps, const at::Tensor& joints_px, const at::Tensor& depth,
                               const at::Tensor& valid, int64_t height, int64_t width, double half_width_px,
                               const DepthRange& range) {
  CheckInputs(joints_px, depth, valid);
  std::vector<at::Tensor> drawn;
  for (const InputMap& map : maps)
    drawn.push_back(
        MapTensor(map, joints_px, depth, valid, height, width, map.thin ? half_width_px / 2 : half_width_px, range));
  return at::stack(drawn, 1);
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

at::Tensor RasterizeMaps(const std::vector<InputMap>& maps, const at::Tensor& joints_px, const at::Tensor& depth,
                         const at::Tensor& valid, int64_t height, int64_t width, double half_width_px,
                         const DepthRange& range) {
  CheckInputs(joints_px, depth, valid);
  const int64_t batch = joints_px.size(0), num_joints = joints_px.size(1), num_maps = static_cast<int64_t>(maps.size());
  const at::Tensor px = joints_px.to(at::kCPU, at::kFloat).contiguous(), z = depth.to(at::kCPU, at::kFloat).contiguous();
  const at::Tensor ok = valid.to(at::kCPU).contiguous();
  at::Tensor out = at::full({batch, num_maps, height, width}, kBoneBackground, at::kFloat);
  float* pixels = out.data_ptr<float>();
  at::parallel_for(0, batch * num_maps, 1, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) {
      const InputMap& map = maps[static_cast<size_t>(i % num_maps)];
      const int64_t row = i / num_maps * num_joints;
      const bool* there = ok.data_ptr<bool>() + row;
      const float *x = px.data_ptr<float>() + 2 * row, *d = z.data_ptr<float>() + row;
      const auto half_width = static_cast<float>(map.thin ? half_width_px / 2 : half_width_px);
      for (const BoneLine& line : map.lines) {
        if (!InList(line, num_joints)) continue;
        if (!std::all_of(line.needs.begin(), line.needs.end(), [there](int j) { return there[j]; })) continue;
        const float *a = x + 2 * line.a, *b = x + 2 * line.b;
        DrawBone({a[0], a[1], b[0], b[1], d[line.a], d[line.b]}, height, width, half_width, range, pixels + i * height * width);
      }
    }
  });
  return out.to(joints_px.device());
}

at::Tensor RasterizeBones(const at::Tensor& joints_px, const at::Tensor& depth, const at::Tensor& valid, int64_t height,
                          int64_t width, double half_width_px, const DepthRange& range) {
  return RasterizeMaps(LayoutOf(kNumBones).maps, joints_px, depth, valid, height, width, half_width_px, range);
}

}  // namespace mvstudio::avatar
