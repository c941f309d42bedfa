#pragma once

#include <torch/script.h>

#include <string>

/// Tiny TorchScript files in place of the nets that users bring.
namespace mvstudio::avatar {

inline void SaveScript(const std::string& path, const std::string& source) {
  torch::jit::Module module("Net");
  module.register_parameter("weight", at::full({1}, 2.0f).requires_grad_(), false);
  module.define(source);
  module.save(path);
}

/// The interface of inception-2015-12-05.pt: levels of 0 to 255, features when asked for them. Three numbers an image, and
/// twelve of its quadrants.
inline void SaveDetector(const std::string& path) {
  SaveScript(path, R"(
def forward(self, img, return_features: bool = False, use_fp16: bool = False, no_output_bias: bool = False):
    x = img.float()
    features = torch.flatten(torch.adaptive_avg_pool2d(x, [2, 2]), 1)
    if return_features:
        result = torch.cat([x.mean([2, 3]), features], 1)
    else:
        result = torch.softmax(features, 1)
    return result
)");
}

/// Mean squared difference of what it is given, (B, 1, 1, 1) as LPIPS returns it, times a half of its weight.
inline void SaveImageDistance(const std::string& path) {
  SaveScript(path, R"(
def forward(self, a, b):
    return (self.weight / 2) * ((a - b) ** 2).mean([1, 2, 3], True)
)");
}

}  // namespace mvstudio::avatar
