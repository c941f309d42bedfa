#pragma once

#include <torch/nn/module.h>
#include <torch/nn/pimpl.h>

#include <cstdint>
#include <memory>
#include <vector>

namespace mvstudio::avatar {

/// Layers of each scale, full size first; the last layer of a scale is the score of each patch (B, 1, h, w).
using PatchFeatures = std::vector<std::vector<at::Tensor>>;

/// Patch discriminators at several scales (Isola et al., "Image-to-image translation with conditional adversarial
/// networks", CVPR 2017; Wang et al., "High-resolution image synthesis with conditional GANs", CVPR 2018). `layers`
/// strided 4x4 convolutions start at `width` channels and double up to 8 times as many, with instance normalisation and
/// leaky ReLU. Each further scale sees the image halved once more by 3x3 means.
class DiscriminatorImpl : public torch::nn::Module {
 public:
  DiscriminatorImpl(int inputs, int width, int layers, int scales, uint64_t seed);
  ~DiscriminatorImpl() override;
  /// (B, inputs, H, W), each scale at least 2^(layers + 1) px.
  PatchFeatures forward(const at::Tensor& image);

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};
TORCH_MODULE(Discriminator);

/// Least-squares GAN (Mao et al., ICCV 2017): mean (score - 1)^2 when `real`, else mean score^2; mean over scales.
at::Tensor PatchLoss(const PatchFeatures& features, bool real);

/// Mean |difference| of all layers but the scores, mean over layers and scales; `real` gets no gradient.
at::Tensor FeatureMatching(const PatchFeatures& fake, const PatchFeatures& real);

}  // namespace mvstudio::avatar
