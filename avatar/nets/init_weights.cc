#include "avatar/nets/init_weights.h"

#include <ATen/CPUGeneratorImpl.h>
#include <torch/torch.h>

namespace mvstudio::avatar {

void InitWeights(torch::nn::Module& module, uint64_t seed) {
  torch::NoGradGuard no_grad;
  at::Generator random = at::detail::createCPUGenerator(seed);
  for (auto& item : module.named_parameters()) {
    at::Tensor& weight = item.value();
    const bool is_bias = item.key().size() >= 4 && item.key().compare(item.key().size() - 4, 4, "bias") == 0;
    if (is_bias) {
      weight.zero_();
    } else {
      weight.normal_(weight.dim() == 1 ? 1.0 : 0.0, 0.02, random);
    }
  }
}

}  // namespace mvstudio::avatar
