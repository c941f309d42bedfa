#pragma once

#include <torch/nn/module.h>

#include <cstdint>

namespace mvstudio::avatar {

/// Convolutions N(0, 0.02), normalisation gains N(1, 0.02), biases 0; depends only on `seed`.
void InitWeights(torch::nn::Module& module, uint64_t seed);

}  // namespace mvstudio::avatar
