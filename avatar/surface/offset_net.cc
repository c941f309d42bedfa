#include "avatar/surface/offset_net.h"

#include <torch/torch.h>

#include <cmath>
#include <string>
#include <vector>

#include "core/check.h"

namespace mvstudio::avatar {
namespace {

namespace nn = torch::nn;

constexpr int kDowns = 3, kHidden = 8, kSkipAt = 4;

nn::Conv2d Conv(int64_t in, int64_t out, int64_t kernel, int64_t stride) {
  return nn::Conv2d(nn::Conv2dOptions(in, out, kernel).stride(stride).padding(stride == 2 ? 1 : kernel / 2));
}

nn::Sequential ConvRelu(int64_t in, int64_t out, int64_t stride) {
  return nn::Sequential(Conv(in, out, stride == 2 ? 4 : 3, stride), nn::ReLU(nn::ReLUOptions(true)));
}

/// He et al., "Delving deep into rectifiers", ICCV 2015: variance 2 over the inputs of each output.
void InitHe(nn::Module& module, uint64_t seed) {
  const torch::NoGradGuard no_gradients;
  auto generator = at::detail::createCPUGenerator(seed);
  for (auto& parameter : module.named_parameters()) {
    at::Tensor& value = parameter.value();
    if (value.dim() < 2) {
      value.zero_();
    } else {
      const double inputs = static_cast<double>(value[0].numel());
      value.normal_(0, std::sqrt(2 / inputs), generator);
    }
  }
}

}  // namespace

struct OffsetNetImpl::Parts {
  nn::Sequential stem{nullptr};
  std::vector<nn::Sequential> downs, ups;
  nn::Conv2d pose{nullptr};
  std::vector<nn::Linear> layers;
  nn::Linear head{nullptr};
  at::Tensor geometry;
};

OffsetNetImpl::OffsetNetImpl(const OffsetNetOptions& options, const OffsetAtlas& atlas, uint64_t seed)
    : parts_(std::make_unique<Parts>()), options_(options), atlas_(atlas) {
  MVS_CHECK(atlas.height % (1 << kDowns) == 0 && atlas.width % (1 << kDowns) == 0,
            "an atlas of " << atlas.width << " x " << atlas.height << " texels");
  const int64_t width = options.unet_width;
  parts_->stem = register_module("stem", ConvRelu(3, width, 1));
  for (int level = 0; level < kDowns; ++level)
    parts_->downs.push_back(register_module("down" + std::to_string(level), ConvRelu(width << level, width << (level + 1), 2)));
  for (int level = kDowns - 1; level >= 0; --level) {
    const int64_t in = (width << (level + 1)) + (width << level);
    parts_->ups.push_back(register_module("up" + std::to_string(level), ConvRelu(in, width << level, 1)));
  }
  parts_->pose = register_module("pose", Conv(width, options.pose_channels, 1, 1));
  const int64_t features = options.pose_channels + options.geometry_channels + 2;
  for (int i = 0; i < kHidden; ++i) {
    const int64_t in = i == 0 ? features : options.mlp_width + (i == kSkipAt ? features : 0);
    parts_->layers.push_back(register_module("layer" + std::to_string(i), nn::Linear(in, options.mlp_width)));
  }
  parts_->head = register_module("head", nn::Linear(options.mlp_width, 3));
  parts_->geometry = register_parameter("geometry", at::zeros({1, options.geometry_channels, atlas.height, atlas.width}));
  InitHe(*this, seed);
  const torch::NoGradGuard no_gradients;
  parts_->geometry.mul_(0.1 / parts_->geometry.std().item<double>());
  parts_->head->weight.zero_();
}

OffsetNetImpl::~OffsetNetImpl() = default;

at::Tensor OffsetNetImpl::forward(const at::Tensor& positions) {
  MVS_CHECK(
      positions.dim() == 4 && positions.size(1) == 3 && positions.size(2) == atlas_.height && positions.size(3) == atlas_.width,
      "positions " << positions.sizes());
  std::vector<at::Tensor> levels;
  at::Tensor x = parts_->stem->forward(positions);
  for (nn::Sequential& down : parts_->downs) levels.push_back(x), x = down->forward(x);
  for (size_t i = 0; i < parts_->ups.size(); ++i) {
    x = at::upsample_nearest2d(x, {2 * x.size(2), 2 * x.size(3)});
    x = parts_->ups[i]->forward(at::cat({x, levels[levels.size() - 1 - i]}, 1));
  }
  const at::Tensor maps = at::cat({at::tanh(parts_->pose->forward(x)), parts_->geometry}, 1);
  const at::Tensor grid = atlas_.vertex_grid.view({1, -1, 1, 2});
  const at::Tensor sampled = at::grid_sampler(maps, grid, 0, 1, false).squeeze(3).squeeze(0).t();  // bilinear, border
  const at::Tensor features = at::cat({sampled, atlas_.vertex_grid}, 1);
  at::Tensor y = features;
  for (size_t i = 0; i < parts_->layers.size(); ++i) {
    if (i == static_cast<size_t>(kSkipAt)) y = at::cat({y, features}, 1);
    y = at::relu(parts_->layers[i]->forward(y));
  }
  return options_.most_m * at::tanh(parts_->head->forward(y));
}

}  // namespace mvstudio::avatar
