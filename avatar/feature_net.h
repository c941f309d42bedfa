#pragma once

#include <ATen/core/Tensor.h>

#include <memory>
#include <string>
#include <vector>

namespace mvstudio::avatar {

/// A fixed network whose activations describe pictures: for the perceptual loss and for distances between sets.
class FeatureNet {
 public:
  virtual ~FeatureNet() = default;
  /// Written into results: numbers of different nets cannot be compared.
  virtual std::string name() const = 0;
  /// Activations from fine to coarse, (B, C, h, w) each, with gradients. rgb: (B, 3, H, W) in [0, 1].
  virtual std::vector<at::Tensor> Levels(const at::Tensor& rgb) const = 0;
  /// One row a picture (B, d): the coarsest level's mean over the picture unless the net has its own.
  virtual at::Tensor Pooled(const at::Tensor& rgb) const;
};

/// A TorchScript file that takes (B, 3, H, W) in [0, 1] and returns a tensor, or a list or tuple of them: e.g. VGG's first
/// twelve layers (relu1_1, relu2_1, relu3_1), which cannot be shipped. Throws IoError / FormatError when it cannot be loaded,
/// and FormatError from Levels when it returns something else.
std::shared_ptr<const FeatureNet> LoadTorchScriptNet(const std::string& path);

/// Mean over levels of the mean |difference| of the activations; `b` gets no gradient. Johnson et al., "Perceptual losses for
/// real-time style transfer and super-resolution", ECCV 2016, with L1 as in the avatar paper.
at::Tensor PerceptualLoss(const FeatureNet& net, const at::Tensor& a, const at::Tensor& b);

}  // namespace mvstudio::avatar
