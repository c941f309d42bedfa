#include "avatar/run/evaluate/strips.h"

#include <ATen/ATen.h>

#include "avatar/run/pack/pack_rows.h"
#include "core/check.h"

namespace mvstudio::avatar {
namespace {

constexpr int64_t kGap = 4;

// Black, red, yellow, white for 0 .. 1: (H, W) -> (3, H, W).
at::Tensor Heat(const at::Tensor& value) {
  const at::Tensor x = 3 * value.clamp(0, 1);
  return at::stack({x.clamp(0, 1), (x - 1).clamp(0, 1), (x - 2).clamp(0, 1)});
}

}  // namespace

Image MakeStrip(const at::Tensor& truth, const at::Tensor& render, const at::Tensor& baseline) {
  MVS_CHECK(truth.dim() == 3 && truth.sizes() == render.sizes() && truth.sizes() == baseline.sizes(),
            "images of different sizes");
  const at::Tensor a = truth.to(at::kDouble), b = render.to(at::kDouble), c = baseline.to(at::kDouble);
  const int64_t zoom = truth.size(1) < 192 ? 2 : 1;
  const auto enlarged = [&](const at::Tensor& x) { return x.repeat_interleave(zoom, 1).repeat_interleave(zoom, 2); };
  const at::Tensor gap = at::full({3, zoom * truth.size(1), kGap}, 0.5, at::kDouble);
  const at::Tensor error = Heat((a - b).abs().mean(0) / 0.5);
  const at::Tensor row = at::cat({enlarged(a), gap, enlarged(b), gap, enlarged(error), gap, enlarged(c)}, 2);
  return ImageOfBytes((row.clamp(0, 1) * 255).round().to(at::kByte));
}

}  // namespace mvstudio::avatar
