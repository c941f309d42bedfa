// Private: layers that the networks of this folder share.
#pragma once

#include <torch/torch.h>

#include <algorithm>

#include "avatar/settings/options.h"

namespace mvstudio::avatar {

/// Channels after `level` stride-2 steps.
inline int ChannelsAt(const ModelOptions& o, int level) { return std::min(o.width << level, 8 * o.width); }

/// Instance normalisation has no parameters, so the strided convolutions before it keep a bias, as the released models do.
inline bool HasBias(const ModelOptions& o) { return o.norm == NormLayer::kInstance; }

inline void AddNorm(const ModelOptions& o, int channels, torch::nn::Sequential& out) {
  if (o.norm == NormLayer::kBatch) {
    out->push_back(torch::nn::BatchNorm2d(channels));
  } else {
    out->push_back(torch::nn::InstanceNorm2d(channels));
  }
}

inline torch::nn::Conv2d Conv(int in, int out, int kernel, int stride, bool bias) {
  const int padding = stride == 2 ? 1 : kernel / 2;
  return torch::nn::Conv2d(torch::nn::Conv2dOptions(in, out, kernel).stride(stride).padding(padding).bias(bias));
}

}  // namespace mvstudio::avatar
