#pragma once

#include <ATen/core/Tensor.h>

#include <memory>
#include <string>
#include <vector>

namespace mvstudio::avatar {

/// A fixed network whose activations describe images, for the perceptual loss and for distances between sets.
class FeatureNet {
 public:
  virtual ~FeatureNet() = default;
  /// Written into results: values of different nets are not comparable.
  virtual std::string name() const = 0;
  /// SHA-256 of the file with the weights; empty for features without weights.
  virtual std::string sha256() const { return ""; }
  /// Activations from fine to coarse, (B, C, h, w) each, with gradients. rgb: (B, 3, H, W) in [0, 1].
  virtual std::vector<at::Tensor> Levels(const at::Tensor& rgb) const = 0;
  /// One row per image (B, d): the coarsest level's mean over the image, unless the net has its own.
  virtual at::Tensor Pooled(const at::Tensor& rgb) const;
};

/// A TorchScript file that takes (B, 3, H, W) in [0, 1] and returns a tensor, or a list or tuple of them. Example: VGG's
/// first twelve layers (relu1_1, relu2_1, relu3_1), which cannot be distributed.
///
/// A file whose `forward` has an argument `return_features` is one of StyleGAN's detectors instead. It gets levels of 0 to
/// 255 (8 bits for Pooled) and `return_features=True`, and resizes them itself.
///
/// Throws IoError / FormatError when it cannot be loaded, and FormatError from Levels and Pooled when it returns something
/// else.
std::shared_ptr<const FeatureNet> LoadTorchScriptNet(const std::string& path);

/// The net of the Frechet Inception distance as distributed by StyleGAN and clean-fid: inception-2015-12-05.pt, 95,607,719
/// bytes.
inline constexpr char kInceptionSha256[] = "f58cb9b6ec323ed63459aa4fb441fe750cfe39fafad6da5cb504a16f19e958f4";

/// Name of a Frechet distance over these features: "FID" for the file above, whatever its name, else "FD (name)".
std::string DistanceName(const std::string& features, const std::string& sha256);

/// Mean over levels of the mean |difference| of the activations; `b` gets no gradient. Activations with a place in the image
/// weigh as the pixels below them do: `weights` (B, 1, H, W) sum to one. Johnson et al., "Perceptual losses for real-time style
/// transfer and super-resolution", ECCV 2016, with L1 as in the avatar paper.
at::Tensor PerceptualLoss(const FeatureNet& net, const at::Tensor& a, const at::Tensor& b, const at::Tensor& weights);

/// A learned distance between two images (LPIPS, Zhang et al., CVPR 2018): a TorchScript file that takes two tensors (B,
/// 3, H, W) in [-1, 1] and returns one number per image, in any shape of B elements.
class ImageDistance {
 public:
  virtual ~ImageDistance() = default;
  virtual std::string name() const = 0;  ///< the file's
  virtual std::string sha256() const = 0;
  /// a, b: (B, 3, H, W) in [0, 1]. Returns (B) float64. Throws FormatError when the file returns something else or NaN.
  virtual at::Tensor operator()(const at::Tensor& a, const at::Tensor& b) const = 0;
};
/// Throws IoError / FormatError.
std::shared_ptr<const ImageDistance> LoadImageDistance(const std::string& path);

}  // namespace mvstudio::avatar
