#include "avatar/nets/discriminator.h"

#include <torch/torch.h>

#include <algorithm>
#include <string>

#include "avatar/nets/init_weights.h"
#include "core/check.h"

namespace mvstudio::avatar {
namespace {

namespace nn = torch::nn;

nn::Conv2d PatchConv(int in, int out, int stride) {
  return nn::Conv2d(nn::Conv2dOptions(in, out, 4).stride(stride).padding(2));
}

/// One scale: each entry is a layer whose output is compared.
std::vector<nn::Sequential> MakeScale(int inputs, int width, int layers) {
  const auto leaky = [] { return nn::LeakyReLU(nn::LeakyReLUOptions().negative_slope(0.2).inplace(true)); };
  std::vector<nn::Sequential> scale = {nn::Sequential(PatchConv(inputs, width, 2), leaky())};
  int channels = width;
  for (int layer = 1; layer <= layers; ++layer) {
    const int next = std::min(width << layer, 8 * width);
    scale.push_back(nn::Sequential(PatchConv(channels, next, layer < layers ? 2 : 1), nn::InstanceNorm2d(next), leaky()));
    channels = next;
  }
  scale.push_back(nn::Sequential(PatchConv(channels, 1, 1)));
  return scale;
}

}  // namespace

struct DiscriminatorImpl::Parts {
  std::vector<std::vector<nn::Sequential>> scales;
};

DiscriminatorImpl::DiscriminatorImpl(int inputs, int width, int layers, int scales, uint64_t seed)
    : parts_(std::make_unique<Parts>()) {
  MVS_CHECK(inputs > 0 && width > 0 && layers > 0 && scales > 0, "a discriminator without inputs, channels, layers or scales");
  for (int s = 0; s < scales; ++s) {
    parts_->scales.push_back(MakeScale(inputs, width, layers));
    for (size_t l = 0; l < parts_->scales.back().size(); ++l) {
      register_module("scale" + std::to_string(s) + "_layer" + std::to_string(l), parts_->scales.back()[l]);
    }
  }
  InitWeights(*this, seed);
}

DiscriminatorImpl::~DiscriminatorImpl() = default;

PatchFeatures DiscriminatorImpl::forward(const at::Tensor& image) {
  PatchFeatures features;
  at::Tensor scaled = image;
  for (std::vector<nn::Sequential>& scale : parts_->scales) {
    if (!features.empty()) scaled = at::avg_pool2d(scaled, 3, 2, 1, false, false);
    at::Tensor x = scaled;
    features.emplace_back();
    for (nn::Sequential& layer : scale) features.back().push_back(x = layer->forward(x));
  }
  return features;
}

at::Tensor PatchLoss(const PatchFeatures& features, bool real) {
  at::Tensor sum;
  for (const std::vector<at::Tensor>& scale : features) {
    const at::Tensor loss = (scale.back() - (real ? 1.0 : 0.0)).square().mean();
    sum = sum.defined() ? sum + loss : loss;
  }
  return sum / static_cast<double>(features.size());
}

at::Tensor FeatureMatching(const PatchFeatures& fake, const PatchFeatures& real) {
  at::Tensor sum;
  int64_t count = 0;
  for (size_t s = 0; s < fake.size(); ++s) {
    for (size_t l = 0; l + 1 < fake[s].size(); ++l, ++count) {
      const at::Tensor loss = (fake[s][l] - real[s][l].detach()).abs().mean();
      sum = sum.defined() ? sum + loss : loss;
    }
  }
  return sum / static_cast<double>(count);
}

}  // namespace mvstudio::avatar
