#pragma once

// Private: has torch's functions in it.

#include <torch/torch.h>

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "avatar/body/offset_net/offset_net.h"

namespace mvstudio::avatar {

/// body::OffsetNet with gradients: the same arrays and the same numbers up to rounding.
class TrainedNet {
 public:
  /// Weights depend only on `seed`: normal, variance 2 over the inputs of each output (He et al., "Delving deep into
  /// rectifiers", ICCV 2015); the geometry feature 0.1. The last layer is 0, so that all offsets are.
  TrainedNet(const body::OffsetAtlas& atlas, const body::OffsetSmoother& smoother, const body::OffsetNetSizes& sizes,
             const body::PositionNorm& norm, uint64_t seed);

  /// Offsets (V, 3), metres, of a body posed as body::MovingOffsets::At takes it.
  at::Tensor Forward(const Eigen::Matrix3Xf& posed) const;

  std::vector<std::pair<std::string, at::Tensor>>& parameters() { return parameters_; }
  body::NetArrays Arrays() const;

 private:
  at::Tensor Of(const std::string& name) const { return by_name_.at(name); }
  at::Tensor Convolve(const std::string& name, const at::Tensor& x, int stride) const;
  at::Tensor Linear(const std::string& name, const at::Tensor& x) const;

  const body::OffsetAtlas* atlas_;
  const body::OffsetSmoother* smoother_;
  body::PositionNorm norm_;
  at::Tensor grid_, coordinates_;  // (1, V, 1, 2), (V, 5)
  std::vector<std::pair<std::string, at::Tensor>> parameters_;
  std::map<std::string, at::Tensor> by_name_;
};

}  // namespace mvstudio::avatar
