#include "avatar/nets/neural_texture.h"

#include <ATen/ATen.h>

#include "core/check.h"

namespace mvstudio::avatar {

at::Tensor SampleCharts(const at::Tensor& texture, const at::Tensor& parts, const at::Tensor& uv) {
  const int64_t charts = texture.size(0), channels = texture.size(1), size = texture.size(2), batch = parts.size(0);
  MVS_CHECK(parts.size(1) == charts && uv.size(1) == 2, "parts " << parts.sizes() << " and coordinates " << uv.sizes());
  // The charts below one another; half a texel from its edges a chart repeats its border, so that none bleeds into the next.
  const at::Tensor sheet = texture.permute({1, 0, 2, 3}).reshape({1, channels, charts * size, size});
  const double edge = 1 - 1.0 / static_cast<double>(size);
  const at::Tensor inside = uv.clamp(-edge, edge), chart = parts.argmax(1).to(uv.dtype());
  const at::Tensor down = (2 * chart + 1 + inside.select(1, 1)) / static_cast<double>(charts) - 1;
  const at::Tensor grid = at::stack({inside.select(1, 0), down}, 3);
  const at::Tensor samples =
      at::grid_sampler(sheet.expand({batch, -1, -1, -1}), grid, /*bilinear*/ 0, /*border*/ 1, /*align_corners=*/false);
  return samples * parts.amax(1, true);
}

}  // namespace mvstudio::avatar
