#include "avatar/maps/texture.h"

#include <ATen/ATen.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/charts/chart_rows.h"
#include "core/check.h"

namespace mvstudio::avatar {
namespace {

constexpr int64_t kParts = 24;

/// Where a coordinate in [-1, 1] falls between two texels (borders repeat).
struct Tap {
  int64_t low, high;
  float share;  // of `high`
};

Tap TapOf(float coordinate, int64_t size) {
  const float x =
      std::clamp(((coordinate + 1.0f) * static_cast<float>(size) - 1.0f) / 2.0f, 0.0f, static_cast<float>(size - 1));
  const auto low = static_cast<int64_t>(std::floor(x));
  return {low, std::min(low + 1, size - 1), x - static_cast<float>(low)};
}

/// Colours (24, 3, S, S) with weights (24, 1, S, S) in [0, 1]: holes filled from coarser levels.
at::Tensor PullPush(const at::Tensor& colour, const at::Tensor& weight) {
  if (colour.size(2) <= 1 || weight.min().item<float>() >= 1.0f) return colour;
  const at::Tensor pooled_weight = at::avg_pool2d(weight, 2, 2, 0, true, false);
  const at::Tensor coarse = at::avg_pool2d(colour * weight, 2, 2, 0, true, false) / pooled_weight.clamp_min(1e-12);
  const at::Tensor filled = PullPush(coarse, (4 * pooled_weight).clamp_max(1));
  const at::Tensor fine = at::upsample_bilinear2d(filled, {colour.size(2), colour.size(3)}, false);
  return weight * colour + (1 - weight) * fine;
}

/// Texels far from all that an image showed take the colour of their row (MeanChartRows). Near ones are left to their
/// neighbours. `colour` (24, 3, S, S) and `weight` (24, 1, S, S) in [0, 1] as for PullPush, which blends the rest.
void FillRows(const TextureSums& sums, at::Tensor* colour, at::Tensor* weight) {
  constexpr double kTrust = 0.7;
  const int64_t near = std::max<int64_t>(1, weight->size(2) / 8);
  const int64_t size = weight->size(2);
  const at::Tensor colour_sums = sums.colour.contiguous(), weight_sums = sums.weight.contiguous();
  ChartRows rows = MeanChartRows(static_cast<int>(size), colour_sums.data_ptr<float>(), weight_sums.data_ptr<float>());
  const at::Tensor row = at::from_blob(rows.colour.data(), {kParts, size, 3}).permute({0, 2, 1}).unsqueeze(3);
  const at::Tensor known = at::from_blob(rows.known.data(), {kParts, 1, size, 1}, at::kByte).gt(0);
  const at::Tensor hole = at::max_pool2d(*weight, 2 * near + 1, 1, near).le(0).logical_and(known);
  *colour = at::where(hole, row, *colour);
  *weight = at::where(hole, at::full_like(*weight, kTrust), *weight);
}

}  // namespace

at::Tensor SampleTextures(const at::Tensor& textures, const at::Tensor& part_prob, const at::Tensor& uv,
                          const at::Tensor& background) {
  const int64_t batch = part_prob.size(0), height = part_prob.size(2), width = part_prob.size(3);
  MVS_CHECK(part_prob.size(1) == kParts + 1 && uv.sizes() == at::IntArrayRef({batch, 2 * kParts, height, width}),
            "part_prob must be (B, 25, H, W) and uv (B, 48, H, W); they are " << part_prob.sizes() << " and " << uv.sizes());
  MVS_CHECK(std::isfinite(uv.detach().sum().item<double>()), "a texture coordinate is not finite");
  const at::Tensor grid = uv.view({batch, 2, kParts, height, width}).permute({2, 0, 3, 4, 1});  // (24, B, H, W, 2)
  const at::Tensor colours = at::grid_sampler_2d(textures, grid.reshape({kParts, batch * height, width, 2}), /*bilinear*/ 0,
                                                 /*border*/ 1, /*align_corners=*/false);
  const at::Tensor prob = part_prob.permute({1, 0, 2, 3});  // (25, B, H, W)
  const at::Tensor body = (colours.view({kParts, 3, batch, height, width}) * prob.slice(0, 1).unsqueeze(1)).sum(0);
  // Blended in [-1, 1]; sum of the 24 probabilities is 1 - background.
  const at::Tensor image = 0.5 * body + 0.5 * (1 - prob[0]) + background.view({3, 1, 1, 1}) * prob[0];
  return image.transpose(0, 1);
}

TextureSums ZeroTextureSums(int64_t size_px) {
  return {at::zeros({kParts, size_px, size_px, 3}, at::kFloat), at::zeros({kParts, size_px, size_px}, at::kFloat)};
}

void AddPixels(TextureSums& sums, const at::Tensor& part, const at::Tensor& uv, const at::Tensor& rgb,
               const at::Tensor& weight) {
  const int64_t count = part.size(0), size = sums.weight.size(1);
  MVS_CHECK(uv.size(0) == count && rgb.size(0) == count && weight.size(0) == count,
            "as many coordinates, colours and weights as parts");
  MVS_CHECK(at::isfinite(uv).all().item<bool>() && at::isfinite(rgb).all().item<bool>(),
            "a coordinate or colour is not finite");
  const at::Tensor part_c = part.contiguous(), uv_c = uv.contiguous(), rgb_c = rgb.contiguous(), weight_c = weight.contiguous();
  const int64_t* parts = part_c.data_ptr<int64_t>();
  const float *uvs = uv_c.data_ptr<float>(), *colours = rgb_c.data_ptr<float>(), *weights = weight_c.data_ptr<float>();
  float *colour_sum = sums.colour.data_ptr<float>(), *weight_sum = sums.weight.data_ptr<float>();
  for (int64_t i = 0; i < count; ++i) {
    MVS_CHECK(parts[i] >= 1 && parts[i] <= kParts, "part " << parts[i]);
    const Tap u = TapOf(uvs[2 * i], size), v = TapOf(uvs[2 * i + 1], size);
    for (int corner = 0; corner < 4; ++corner) {
      const int64_t x = corner & 1 ? u.high : u.low, y = corner & 2 ? v.high : v.low;
      const float w = weights[i] * (corner & 1 ? u.share : 1 - u.share) * (corner & 2 ? v.share : 1 - v.share);
      const int64_t texel = ((parts[i] - 1) * size + y) * size + x;
      weight_sum[texel] += w;
      for (int c = 0; c < 3; ++c) colour_sum[3 * texel + c] += w * colours[3 * i + c];
    }
  }
}

at::Tensor FillTextures(const TextureSums& sums, double min_weight) {
  at::Tensor colour = (sums.colour / sums.weight.clamp_min(1e-12).unsqueeze(-1)).permute({0, 3, 1, 2}).contiguous();
  at::Tensor weight = (sums.weight / min_weight).clamp(0, 1).unsqueeze(1);
  FillRows(sums, &colour, &weight);
  const at::Tensor total = sums.weight.sum();
  const at::Tensor mean = sums.colour.sum({0, 1, 2}) / total.clamp_min(1e-12);
  const at::Tensor filled = PullPush(colour, weight);
  const at::Tensor has_colour = (weight.sum({1, 2, 3}) > 0).view({kParts, 1, 1, 1});
  return at::where(has_colour, filled, mean.view({1, 3, 1, 1})).contiguous();
}

}  // namespace mvstudio::avatar
