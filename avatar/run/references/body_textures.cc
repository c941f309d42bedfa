#include "avatar/run/references/body_textures.h"

#include <ATen/ATen.h>

#include <algorithm>
#include <vector>

namespace mvstudio::avatar {

at::Tensor TexturesToTensor(const body::Textures& textures) {
  std::vector<at::Tensor> charts;
  for (const Image& chart : textures) {
    at::Tensor hwc = at::zeros({chart.height, chart.width, 3}, at::kByte);
    std::copy(chart.pixels.begin(), chart.pixels.end(), hwc.data_ptr<uint8_t>());
    charts.push_back(hwc.permute({2, 0, 1}).to(at::kFloat) * (2.0 / 255) - 1);
  }
  return at::stack(charts);
}

}  // namespace mvstudio::avatar
