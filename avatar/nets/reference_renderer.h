#pragma once

#include <torch/nn/module.h>
#include <torch/nn/pimpl.h>

#include <memory>

#include "avatar/settings/options.h"

namespace mvstudio::avatar {

/// Channels of references in an image: RGB on black, and where there are any.
inline constexpr int kReferenceMaps = 4;

/// Channels of a ReferenceRenderer's input: neural texture, the fitted body's image on black, its cover, references.
int NumRendererChannels(const ModelOptions& options);

/// The reference-based neural renderer of Zhao et al., "High-Fidelity Human Avatars from a Single RGB Camera", CVPR 2022: a
/// U-Net of strided convolutions (4x4, instance norm, leaky ReLU) and bilinear enlargements, with a second encoder for warped
/// references that joins it at the smallest size. `skips` adds to the paper's skip connections those of the two largest sizes
/// and those of the references; without them it is the paper's network, but for the input's and output's channels.
///
/// Input (B, NumRendererChannels, H, W), as RendererInput (model.h) makes it. Output (B, 4, H, W): corrections of the person's
/// logit and of the colours before tanh; 0 for a new network.
class ReferenceRendererImpl : public torch::nn::Module {
 public:
  explicit ReferenceRendererImpl(const ModelOptions& options);
  ~ReferenceRendererImpl() override;
  at::Tensor forward(const at::Tensor& input);
  void BeginAtZero();
  bool IsZero() const;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};
TORCH_MODULE(ReferenceRenderer);

}  // namespace mvstudio::avatar
