#pragma once

#include <torch/nn/module.h>
#include <torch/nn/pimpl.h>

#include <cstdint>
#include <memory>

/// Offsets of a surface as a network of the posed body: Zhao et al., "High-Fidelity Human Avatars from a Single RGB Camera",
/// CVPR 2022, section 3.1.
namespace mvstudio::avatar {

struct OffsetNetOptions {
  int64_t unet_width = 16;         ///< channels of the U-Net's finest level; doubled at each of three coarser ones
  int64_t pose_channels = 64;      ///< of the pose feature
  int64_t geometry_channels = 64;  ///< of the learned geometry feature
  int64_t mlp_width = 256;         ///< of the MLP's eight layers
  double most_m = 0.1;             ///< of each coordinate of an offset
};

/// The surface's atlas: where vertices and texels lie.
struct OffsetAtlas {
  int64_t height = 0, width = 0;  ///< texels; multiples of 8
  at::Tensor vertex_grid;         ///< (V, 2) float: x, y of each vertex in [-1, 1], as grid_sample takes them
};

class OffsetNetImpl : public torch::nn::Module {
 public:
  /// Weights depend only on `seed`; the offsets begin at 0.
  OffsetNetImpl(const OffsetNetOptions& options, const OffsetAtlas& atlas, uint64_t seed);
  ~OffsetNetImpl() override;

  /// positions: (1, 3, height, width) of the posed body's surface, metres, 0 where no texel is. Offsets (V, 3), metres.
  at::Tensor forward(const at::Tensor& positions);

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
  OffsetNetOptions options_;
  OffsetAtlas atlas_;
};
TORCH_MODULE(OffsetNet);

}  // namespace mvstudio::avatar
