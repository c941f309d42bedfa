#pragma once

#include <torch/nn/module.h>
#include <torch/nn/pimpl.h>

#include <memory>
#include <string>
#include <utility>

#include "avatar/settings/options.h"

namespace mvstudio::avatar {

inline constexpr int kNumPrevious = 2;
/// Number of input channels beside the bone maps.
int NumPreviousChannels(const ModelOptions& options);
/// Input channels before the template's: the bones; none for `hf`.
int NumBoneChannels(const ModelOptions& options);

/// Names of the two decoders in a checkpoint.
std::pair<std::string, std::string> DecoderNames(Method method);

/// The convolutional network of Shysheya et al., CVPR 2019: one encoder, two decoders. `skips` adds the encoder's features
/// to the decoders', which the paper's network does not.
///
/// Input: bone maps (B, inputs, H, W), and the template's channels where it is the prior (template_maps.h); the heads that
/// it is added to are then initialised to 0. Outputs:
///   `tna`: part logits (B, 25, H, W), channel 0 the background, and texture coordinates before tanh (B, 48, H, W), 24
///     u then 24 v.
///   `direct`: a foreground logit (B, 1, H, W) and colours before tanh (B, 3, H, W).
///   `v2v`, whose input also holds the kNumPrevious previous images: a foreground logit and (B, 6, H, W), colours
///     before tanh, flow, weight logit.
///   `hf`: as `direct`, from the input of a ReferenceRenderer (reference_renderer.h), which it is.
class GeneratorImpl : public torch::nn::Module {
 public:
  GeneratorImpl(const ModelOptions& options, uint64_t seed);
  ~GeneratorImpl() override;
  std::pair<at::Tensor, at::Tensor> forward(const at::Tensor& bone_maps);

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
  int size_multiple_ = 1;
};
TORCH_MODULE(Generator);

/// Number of trainable parameters of the network alone (no textures), computed by building it.
int64_t NumParameters(const ModelOptions& options);

}  // namespace mvstudio::avatar
